test_that("a bandit pays each arm's mean, with the noise that it has", {
  env <- bandit(mean = c(-1, 0, 2), sd = 0.5, horizon = 20)
  expect_identical(env$single_action_space$n, 3L)
  played <- rollout(env, policy_random(), episodes = 500, seed = 1, steps = TRUE)
  each <- tapply(played$steps$reward, played$steps$action, mean)
  expect_equal(as.vector(each), c(-1, 0, 2), tolerance = 0.05)
  spread <- tapply(played$steps$reward, played$steps$action, stats::sd)
  expect_equal(as.vector(spread), rep(0.5, 3), tolerance = 0.05)
  expect_true(all(played$episodes$length == 20))
  expect_true(all(played$episodes$truncated))
})

test_that("without means each episode draws its own", {
  played <- rollout(bandit(arms = 2, sd = 0, horizon = 2), function(state) 0L * state,
                    episodes = 400, seed = 1, steps = TRUE)
  first <- played$steps$reward[played$steps$step == 1]
  expect_identical(first, played$steps$reward[played$steps$step == 2])
  expect_equal(stats::sd(first), 1, tolerance = 0.15)
  moving <- rollout(bandit(mean = 0, sd = 0, drift = 1, horizon = 30), function(state) 0L * state,
                    episodes = 400, seed = 1, steps = TRUE)
  steps <- diff(moving$steps$reward)[diff(moving$steps$episode) == 0]
  expect_equal(stats::sd(steps), 1, tolerance = 0.05)
})

test_that("the testbed's curves are those of the book", {
  skip_unless_all()
  # Sutton and Barto (2018), figures 2.2 and 2.4, to the eye: after 1,000 steps greedy gets about 1,
  # epsilon 0.1 about 1.4 and the best arm in four fifths of the cases.
  testbed <- bandit(arms = 10)
  late <- function(...) {
    utils::tail(learn_bandit(testbed, ..., learners = 500, seed = 1)$curve, 100)
  }
  greedy <- late(epsilon = 0)
  explores <- late(epsilon = 0.1)
  ucb <- late("ucb")
  gradient <- late("gradient")
  expect_equal(mean(greedy$mean_reward), 1.05, tolerance = 0.08)
  expect_equal(mean(explores$mean_reward), 1.38, tolerance = 0.05)
  expect_equal(mean(explores$best_share), 0.8, tolerance = 0.05)
  expect_gt(mean(ucb$mean_reward), mean(explores$mean_reward))
  expect_gt(mean(gradient$best_share), 0.7)
})

test_that("a seed fixes all that is drawn, and the session's generator stays as it was", {
  testbed <- bandit(arms = 4, horizon = 30)
  set.seed(5)
  state <- globalenv()$.Random.seed
  first <- learn_bandit(testbed, learners = 20, seed = 3)
  expect_identical(globalenv()$.Random.seed, state)
  expect_identical(learn_bandit(testbed, learners = 20, seed = 3), first)
  expect_false(identical(learn_bandit(testbed, learners = 20, seed = 4)$curve, first$curve))
})

test_that("one learner follows its method step by step", {
  # Without noise: the value of an arm that was taken is its mean.
  sure <- bandit(mean = c(1, 3, 2), sd = 0)
  ucb <- learn_bandit(sure, "ucb", learners = 1, horizon = 3, seed = 1)
  expect_identical(ucb$values[1, ], c(1, 3, 2))
  constant <- learn_bandit(sure, learning_rate = 0.5, initial = 8, epsilon = 0, learners = 1,
                           horizon = 3, seed = 1)
  # Optimism makes it try each arm once.
  expect_identical(constant$values[1, ], c(4.5, 5.5, 5))
  one <- learn_bandit(sure, "gradient", learning_rate = 0.1, baseline = FALSE, learners = 1,
                      horizon = 1, seed = 1)
  arm <- which.max(one$values[1, ])
  expected <- rep(-1 / 3, 3)
  expected[[arm]] <- 2 / 3
  expect_equal(one$values[1, ], 0.1 * c(1, 3, 2)[[arm]] * expected)
})

test_that("what was learned prints and plots, several together", {
  testbed <- bandit(arms = 3, horizon = 20)
  few <- learn_bandit(testbed, epsilon = 0, learners = 50, seed = 1)
  ucb <- learn_bandit(testbed, "ucb", learners = 50, seed = 1)
  expect_output(print(few), "50 learners in Bandit-3: epsilon 0\nLast 20 steps of 20")
  expect_identical(names(as.data.frame(few)), c("step", "mean_reward", "best_share"))
  picture <- drawn(ggplot2::autoplot(few, bound = ucb, few, what = "best_share"))
  expect_identical(key_of(picture), c("epsilon 0", "bound", "epsilon 0, again 1"))
  expect_identical(layers_of(picture, "GeomLine")[[1]]$y[1:20], few$curve$best_share)
  expect_error(plot(few, 3), class = "gym_error_argument")
})

test_that("what is no bandit, or no method, is refused", {
  refused <- function(code, text) {
    expect_error(code, text, class = "gym_error_argument", fixed = TRUE)
  }
  refused(bandit(2, mean = 1:3), "`mean` must be a finite number for each of 2 arms")
  refused(bandit(sd = -1), "`sd` must be a number of at least 0")
  refused(learn_bandit("CartPole-v1"), "`env` must be a bandit")
  refused(learn_bandit(bandit(), "exp3"), "one of \"epsilon_greedy\"")
  refused(learn_bandit(bandit(), epsilon = 2), "`epsilon` must be a number from 0 to 1")
})

test_that("all learners of a plot may be named", {
  testbed <- bandit(arms = 3, horizon = 20)
  greedy <- learn_bandit(testbed, epsilon = 0, learners = 5, seed = 1)
  often <- learn_bandit(testbed, epsilon = 0.1, learners = 5, seed = 1)
  local_device()
  expect_identical(key_of(plot(never = greedy, sometimes = often)), c("never", "sometimes"))
  expect_identical(key_of(plot(greedy, sometimes = often)), c("epsilon 0", "sometimes"))
})

# Whether an action pays depends on age; actions are drawn with the probabilities p.
logged_clicks <- function(n, p = c(0.5, 0.5)) {
  data <- data.frame(episode = seq_len(n), age = stats::runif(n))
  data$action <- sample(c("ad", "news"), n, replace = TRUE, prob = p)
  pays <- ifelse(data$action == "ad", data$age, 1 - data$age)
  data$reward <- stats::rbinom(n, 1, pays)
  data$probability <- p[match(data$action, c("ad", "news"))]
  data
}

test_that("learners with contexts learn from logged data", {
  set.seed(1)
  for (p in list(c(0.5, 0.5), c(0.8, 0.2))) {
    data <- logged_clicks(3000, p)
    for (method in c("linucb", "thompson")) {
      learned <- learn_bandit(data, method, seed = 1)
      expect_equal(predict(learned$policy, data.frame(age = c(0.1, 0.9))), c("news", "ad"))
      # The best rule gets 0.75 a step.
      expect_gt(learned$reward, 0.75 - 4 * learned$se - 0.03)
      # Half of what is left of 3,000, or of 1,200, is of the chosen action.
      expect_lt(abs(learned$seen - 3000 * min(p)), 150)
    }
  }
  expect_identical(learn_bandit(data, "thompson", seed = 1), learned)
  expect_output(print(learned), "mean reward")
  expect_s3_class(ggplot2::autoplot(learned), "ggplot")
})

test_that("the models of LinUCB are ridge regressions", {
  set.seed(1)
  data <- logged_clicks(200)
  data$action <- "ad"
  data$probability <- 1
  x <- cbind(1, data$age)
  by_hand <- solve(diag(2) + crossprod(x), crossprod(x, data$reward))
  expect_equal(unname(learn_bandit(data, "linucb")$values), by_hand, tolerance = 1e-10)
})

test_that("a replay needs logged data, and other methods a bandit", {
  expect_error(learn_bandit(bandit(3), "linucb"), "logged steps")
  expect_error(learn_bandit(logged_clicks(10), "ucb"), "\"linucb\"")
})

test_that("data without probabilities is replayed without a warning", {
  set.seed(1)
  clicks <- data.frame(episode = 1:100, age = runif(100), action = 0:1, reward = 0:1)
  expect_warning(learn_bandit(clicks, "linucb", seed = 1), NA)
})

test_that("learners with contexts learn in an environment", {
  matching <- gym_env(
    reset = function(self) self$shown <- sample(0:2, 1),
    step = function(self, action) {
      pays <- (action[[1]] == self$shown) + action[[2]]
      list(observation = self$shown, reward = pays, terminated = TRUE)
    },
    observation_space = space_discrete(3), action_space = space_multi_discrete(c(3, 2)),
    id = "Matching"
  )
  for (method in c("linucb", "thompson")) {
    learned <- learn_bandit(matching, method, horizon = 400, seed = 1)
    expect_identical(learned, learn_bandit(matching, method, horizon = 400, seed = 1))
    # Each value of the context has a weight, and each combination of parts is an action.
    expect_identical(dim(learned$values), c(3L, 6L))
    expect_identical(learned$curve$mean_reward[[400]], mean(learned$policy$steps$reward))
    played <- rollout(matching, learned$policy, episodes = 20, seed = 2)
    expect_identical(played$episodes$return, rep(2, 20))
    expect_output(print(learned), "in Matching: .*\nIt saw 400 steps: mean reward")
  }
  # The models are ridge regressions of the steps that were played.
  steps <- learned$policy$steps
  x <- cbind(1, steps$state[[1]] == 1, steps$state[[1]] == 2)
  for (action in seq_len(6)) {
    own <- steps$action == action
    by_hand <- solve(diag(3) + crossprod(x[own, , drop = FALSE]),
                     crossprod(x[own, , drop = FALSE], steps$reward[own]))
    expect_equal(unname(learned$values[, action]), by_hand[, 1], tolerance = 1e-8)
  }
  # An episode may have many steps; its observations are numbers.
  balanced <- learn_bandit("CartPole-v1", "linucb", horizon = 40, seed = 1)
  expect_gt(max(balanced$policy$steps$episode), 1L)
  expect_output(print(balanced$policy), "LinUCB")
  expect_error(learn_bandit("Pendulum-v1", "linucb"), "Box", class = "gym_error_argument")
})

test_that("an interrupt of a learner in an environment keeps what it learned", {
  interrupting <- gym_env(
    reset = function(self) runif(1),
    step = function(self, action) {
      self$steps <- self$steps + 1
      if (self$steps == 11) rlang::interrupt()
      list(observation = 0, reward = 1, terminated = TRUE)
    },
    observation_space = space_box(0, 1), action_space = space_discrete(2), steps = 0
  )
  expect_message(
    learned <- learn_bandit(interrupting, "linucb", horizon = 30, seed = 1),
    "in 10 of 30 steps", class = "gym_message_interrupted"
  )
  expect_identical(c(learned$seen, learned$rows, nrow(learned$curve)), c(10L, 10L, 10L))
  whole <- learn_bandit(interrupting, "linucb", horizon = 10, seed = 1)
  expect_identical(learned$values, whole$values)
})
