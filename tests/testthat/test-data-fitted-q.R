test_that("batch Q-learning solves the model of the steps", {
  model <- gym_model(data.frame(
    state = c(0, 0, 0, 0, 1, 1, 1, 1), action = c(0, 0, 1, 1),
    next_state = c(0, 1, 1, 2, 0, 2, 1, 0), probability = c(0.7, 0.3, 0.6, 0.4, 0.5, 0.5, 0.8, 0.2),
    reward = c(0, 1, -1, 2, 0, 1, 1, 3)
  ))
  played <- rollout(model, policy_random(), episodes = 300, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  for (discount in c(0.5, 0.9, 0.99)) {
    solved <- solve_mdp(estimate_model(played), discount = discount)
    learned <- learn_q(played, discount = discount)
    found <- state_values(learned)
    expect_equal(found$value, unname(solved$values[as.character(found$obs_1)]), tolerance = 1e-8)
    q <- state_values(learned, actions = TRUE)
    expect_equal(q$value, as.vector(t(solved$q[as.character(unique(q$obs_1)), ])), tolerance = 1e-8)
    expect_equal(predict(learned, data.frame(obs_1 = 0:1)), solved$actions[1:2])
  }
  expect_error(learn_q(played, epsilon = 0.1), "`learn_q\\(\\)` has no argument `epsilon`")
})

# Two treatments; the first one prepares for the second. By hand: with x uniform on -1, 1, the best
# second treatment is 1 if x2 > 0, worth |x2|; x2 = x1 + a1 + noise. See the sums below.
two_stages <- function(n) {
  x1 <- sample(c(-1, 1), n, replace = TRUE)
  a1 <- sample(0:1, n, replace = TRUE)
  x2 <- x1 * (2 * a1 - 1) + sample(c(-0.5, 0.5), n, replace = TRUE)
  a2 <- sample(0:1, n, replace = TRUE)
  data.frame(
    patient = rep(seq_len(n), 2), stage = rep(1:2, each = n), x = c(x1, x2), action = c(a1, a2),
    reward = c(0.2 * a1, a2 * x2)
  )
}

test_that("backward induction finds the regime that is best by hand", {
  # The second treatment is worth max(x2, 0). With x1 = 1: treated x2 is 0.5 or 1.5, worth 1 on
  # average, and 0.2 more; untreated x2 is negative. With x1 = -1 it is the other way round.
  set.seed(1)
  steps <- steps_data(two_stages(4000), "patient", "x", time = "stage")
  rule <- learn_fitted_q(steps, ~ action * x * I(x > 0), horizon = 2, stages = TRUE)
  q <- predict(rule, data.frame(x = c(-1, 1), step = 1), type = "output")
  expect_equal(unname(q), rbind(c(1, 0.2), c(0, 1.2)), tolerance = 0.05)
  expect_equal(predict(rule, data.frame(x = c(-1, 1), step = 1)), 0:1)
  expect_equal(predict(rule, data.frame(x = c(-0.5, 0.5), step = 2)), 0:1)
  # Its value, by other data: the mean of 1 and 1.2.
  set.seed(2)
  fresh <- steps_data(two_stages(2000), "patient", "x", time = "stage")
  found <- evaluate_offline(
    fresh, rule, behavior = policy_random(), formula = ~ action * x * I(x > 0), horizon = 2,
    stages = TRUE, replicates = 50, seed = 1
  )$estimates
  expect_lt(max(abs(found$estimate - 1.1) / found$se), 3.5)
})

test_that("any regression learns, such as a tree", {
  skip_if_not_installed("rpart")
  set.seed(1)
  steps <- steps_data(two_stages(500), "patient", "x", time = "stage")
  rule <- learn_fitted_q(steps, model = rpart::rpart, horizon = 2, stages = TRUE)
  expect_equal(predict(rule, data.frame(x = c(-1, 1), step = 1)), 0:1)
  expect_error(
    learn_fitted_q(steps, model = function(formula, data) stop("no")), "cannot be fitted"
  )
})

test_that("double Q-learning values less by chance", {
  # All actions are worth nothing.
  set.seed(1)
  steps <- data.frame(episode = 1:200, s = "a", action = rep(1:10, 20), reward = rnorm(200))
  before <- data.frame(episode = 1:200, s = "start", action = 1L, reward = 0)
  data <- rbind(before, steps)
  data$step <- rep(1:2, each = 200)
  first <- function(double) {
    values <- state_values(learn_q(steps_data(data), discount = 1, double = double))
    values$value[values$s == "start"]
  }
  expect_gt(first(FALSE), 0.2)
  expect_lt(abs(first(TRUE)), abs(first(FALSE)))
})

test_that("a rule plays in the environment of its data", {
  walk <- gym_model(data.frame(
    state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
    reward = c(0, 0, 0, 1)
  ), start = 1, max_episode_steps = 50)
  played <- rollout(walk, policy_random(), episodes = 100, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  expect_equal(rollout(walk, learn_q(played), episodes = 3, seed = 1)$episodes$return, c(1, 1, 1))
  linear <- learn_fitted_q(played, discount = 0.9)
  expect_equal(rollout(walk, linear, episodes = 3, seed = 1)$episodes$return, c(1, 1, 1))
})

test_that("a rule plays actions of several parts", {
  for (space in spaces_of_parts) {
    env <- env_of_parts(space)
    played <- rollout(env, policy_random(), episodes = 60, seed = 1, steps = TRUE,
                      next_observation = TRUE)
    rule <- learn_q(played, discount = 0.5)
    expect_equal(unlist(predict(rule, data.frame(obs_1 = 1))), c(1, 2), ignore_attr = TRUE)
    expect_equal(rollout(env, rule, episodes = 2, seed = 1)$episodes$return, c(8, 8))
    solved <- as.data.frame(solve_mdp(estimate_model(played), discount = 0.5))
    expect_equal(unlist(solved[2, 3:4]), c(1, 2), ignore_attr = TRUE)
  }
})

test_that("a rule with a horizon counts the steps of each episode that it plays", {
  # On the right staying pays 2 and leaving 3, so the last step is the one to leave.
  walk <- gym_model(data.frame(
    state = c(1, 1, 2, 2, 3, 3), action = c(0, 1), next_state = c(1, 2, 1, 3, 1, 3),
    reward = c(1, 0, 1, 0, 3, 2)
  ), start = 1, max_episode_steps = 4)
  played <- rollout(walk, policy_random(), episodes = 300, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  rule <- learn_fitted_q(played, horizon = 4)
  expect_equal(rollout(walk, rule, episodes = 5, seed = 1)$episodes$return, rep(5, 5))
  # With other policies, and beside shorter episodes.
  both <- rollout(walk, list(rule, policy_random()), episodes = 3, seed = 1, steps = TRUE)$steps
  own <- both[both$candidate == 1, ]
  expect_equal(own$action, rep(c(1, 1, 1, 0), 3))
  short <- learn_fitted_q(played, horizon = 2)
  expect_equal(rollout(walk, short, episodes = 1, seed = 1)$episodes$return, 4)
  expect_error(evaluate_policy(walk, rule), "has a memory")
})

test_that("a rule prints what it does", {
  set.seed(1)
  data <- data.frame(episode = 1:100, x = runif(100), s = c("high", "low"),
                     action = sample(c("new", "old"), 100, replace = TRUE))
  data$reward <- ifelse(data$action == "new", data$x, 0.5)
  expect_snapshot(print(learn_fitted_q(data[-3])))
  expect_snapshot(print(learn_q(data[-2])))
  expect_error(predict(learn_q(data[-2]), data.frame(s = "mid")), "The rule knows no s \"mid\"")
})

test_that("the frozen lake is solved from random play", {
  skip_unless_all()
  played <- rollout("FrozenLake-v1", policy_random(), episodes = 2000, seed = 1, steps = TRUE,
                    client = test_client())
  table <- learn_q(played, discount = 0.95)
  q <- state_values(table, actions = TRUE)
  solved <- solve_mdp(estimate_model(steps_data(played)), discount = 0.95)
  expect_equal(q$value, as.vector(t(solved$q[as.character(unique(q$position)), ])),
               tolerance = 1e-8)
  # A linear model with a coefficient for each state is the same table.
  linear <- learn_fitted_q(played, ~ action * factor(position), discount = 0.95, iterations = 400)
  expect_equal(state_values(linear, actions = TRUE)$value, q$value, tolerance = 1e-6)
  # It does as well in the lake as the best policy.
  lake <- env_model("FrozenLake-v1", client = test_client())
  learned <- predict(table, data.frame(position = 0:15))
  worth <- solve_mdp(lake, learned, discount = 0.95)$start_value
  expect_gt(worth, 0.9 * solve_mdp(lake, discount = 0.95)$start_value)
})
