test_that("both methods find the best values, and the actions that have them", {
  for (method in c("value_iteration", "policy_iteration")) {
    solved <- solve_mdp(walk_model(), discount = 0.9, method = method)
    expect_equal(unname(solved$values), c(0, 0.9, 1, 0), tolerance = 1e-12)
    expect_identical(solved$actions[2:3], c(1L, 1L))
    expect_equal(solved$start_value, 0.9, tolerance = 1e-12)
    expect_equal(unname(solved$q[2:3, ]), rbind(c(0, 0.9), c(0.81, 1)), tolerance = 1e-12)
  }
})

test_that("the value of a given policy solves its equations", {
  # The random walk of Sutton and Barto's example 6.2 with two states: 1/3 and 2/3.
  solved <- solve_mdp(walk_model(), policy = policy_random())
  expect_equal(unname(solved$values), c(0, 1, 2, 0) / 3, tolerance = 1e-12)
  expect_null(solved$actions)
  by_matrix <- solve_mdp(walk_model(), policy = matrix(0.5, 4, 2))
  expect_equal(by_matrix$values, solved$values)
  # Always to the left.
  expect_equal(unname(solve_mdp(walk_model(), policy = c(0, 0, 0, 0))$values), numeric(4))
  by_function <- solve_mdp(walk_model(), policy = function(state) as.integer(state > 0))
  expect_equal(unname(by_function$values), c(0, 1, 1, 0))
})

test_that("rewards that go on for ever have no finite value, and are told apart", {
  endless <- solve_mdp(endless_model(-1), policy = c(0, 0))
  expect_identical(unname(endless$values), c(-Inf, 0))
  expect_identical(unname(solve_mdp(endless_model(2), policy = c(0, 0))$values), c(Inf, 0))
  # Going on without a reward is worth nothing.
  expect_identical(unname(solve_mdp(endless_model(0), policy = c(0, 0))$values), c(0, 0))
  expect_equal(solve_mdp(endless_model(-1), policy = c(0, 0), discount = 0.5)$start_value, -2)
  # The best policy ends it.
  expect_equal(solve_mdp(endless_model(-1))$start_value, 5)
})

test_that("values without an end are refused, with what to give", {
  skip_unless_all()
  circle <- gym_model(data.frame(state = 0:1, action = 0, next_state = 1:0, reward = 1))
  expect_error(solve_mdp(circle), "rewards go on.*`discount` below 1, or a `horizon`",
               class = "gym_error_argument")
  costs <- gym_model(data.frame(state = 0:1, action = 0, next_state = 1:0, reward = -1))
  expect_error(solve_mdp(costs), "never end, and without a discount", class = "gym_error_argument")
  expect_equal(solve_mdp(circle, discount = 0.5)$start_value, 2)
  expect_equal(solve_mdp(circle, horizon = 7)$start_value, 7)
  for (method in c("value_iteration", "policy_iteration")) {
    expect_error(solve_mdp(endless_model(2), method = method), "some values are infinite",
                 class = "gym_error_argument")
  }
})

test_that("of equal actions those are taken by which episodes end soonest", {
  # Without a discount it is worth the same to go the long way, or round in circles.
  table <- data.frame(
    state = c(0, 0, 0, 1, 1), action = c(0, 1, 2, 0, 1), next_state = c(0, 1, 2, 0, 2),
    reward = c(0, 0, 1, 0, 1), terminated = c(FALSE, FALSE, TRUE, FALSE, TRUE)
  )
  for (method in c("value_iteration", "policy_iteration")) {
    solved <- solve_mdp(gym_model(table, start = 0), method = method)
    expect_identical(solved$actions[1:2], c(2L, 1L))
  }
  expect_equal(evaluate_policy(solved$model, solved$policy)$mean_length, 1)
})

test_that("with a horizon the best action depends on the steps that are left", {
  # A reward of 1 a step, or 3 at once, which ends it.
  model <- gym_model(data.frame(
    state = c(0, 0), action = c(0, 1), next_state = c(0, 1), reward = c(1, 3)
  ), start = 0)
  solved <- solve_mdp(model, horizon = 5)
  expect_equal(solved$start_value, 7)
  expect_identical(solved$actions[1, ], c(0L, 0L, 0L, 0L, 1L))
  expect_null(solved$policy)
  expect_error(predict(solved, 0), "depends on the step", class = "gym_error_argument")
  expect_equal(solve_mdp(model, policy = c(0, 0), horizon = 5)$start_value, 5)
  expect_output(print(solved), "within 5 steps by a policy that counts them  7", fixed = TRUE)
})

test_that("the sweeps are kept on request, as a lecture draws them", {
  solved <- solve_mdp(walk_model(), trace = TRUE)
  expect_identical(
    solved$trace, rbind(numeric(4), c(0, 0, 1, 0), c(0, 1, 1, 0), c(0, 1, 1, 0))
  )
  expect_identical(nrow(solved$trace), solved$sweeps + 1L)
  expect_identical(dim(solve_mdp(walk_model(), horizon = 6, trace = TRUE)$trace), c(7L, 4L))
  expect_null(solve_mdp(walk_model())$trace)
})

test_that("a solution is a table, a policy and a print", {
  solved <- solve_mdp(walk_model(id = "Walk", max_episode_steps = 1))
  expect_identical(
    as.data.frame(solved),
    data.frame(state = 0:3, value = c(0, 1, 1, 0), action = c(NA, 1L, 1L, NA))
  )
  expect_identical(act(solved$policy, c(1L, 2L)), c(1L, 1L))
  # One step does not suffice.
  expect_identical(solved$limited, 0)
  expect_output(print(solved), "the same policy, cut off after 1 step  0", fixed = TRUE)
})

test_that("in a terminal state there is no best action, in tables and pictures", {
  expect_identical(solve_mdp(walk_model())$actions, c(NA, 1L, 1L, NA))
  within <- solve_mdp(walk_model(), horizon = 2)
  expect_identical(within$actions[c(1, 4), ], matrix(NA_integer_, 2, 2))
  for (given in list(list(), list(policy = policy_table(matrix(c(1, 0), 4, 2, byrow = TRUE))))) {
    solved <- rlang::exec(solve_mdp, walk_model(), !!!given)
    cells <- ggplot2::autoplot(solved)$data
    expect_identical(is.na(cells$action[cells$panel == "value"]), c(TRUE, FALSE, FALSE, TRUE))
    expect_identical(cells$state[cells$panel == "action"], 1:2)
  }
})

test_that("policies that do not fit the model are refused", {
  refused <- function(policy, text) {
    expect_error(solve_mdp(walk_model(), policy = policy), text, class = "gym_error_argument",
                 fixed = TRUE)
  }
  refused(c(0, 1), "the number of an action for each of 4 states")
  refused(c(0, 1, 2, 0), "the number of an action for each of 4 states")
  refused(matrix(0.5, 2, 2), "a matrix of probabilities, with 4 rows and 2 columns")
  refused(policy_table(matrix(0, 3, 2)), "has 4 states and 2 actions")
  barred <- gym_model(walk_table()[-3, ], start = 1)
  expect_error(solve_mdp(barred, policy = c(0, 0, 0, 0)),
               "takes action 0 in state 2, where the model does not have that action",
               class = "gym_error_argument")
  expect_error(solve_mdp(walk_model(), discount = 1.5), "above 0 and at most 1",
               class = "gym_error_argument")
  expect_error(solve_mdp(3), "`model` must be a model", class = "gym_error_argument")
})

test_that("a policy is evaluated exactly, several together", {
  evaluated <- evaluate_policy(
    walk_model(), list(random = policy_random(), right = c(1, 1, 1, 1))
  )
  expect_identical(row.names(evaluated), c("random", "right"))
  expect_equal(evaluated$mean_return, c(1 / 3, 1))
  expect_equal(evaluated$mean_length, c(2, 2))
  expect_identical(evaluate_policy(walk_model(), c(1, 1, 1, 1), max_steps = 1)$mean_return, 0)
  limited <- walk_model(max_episode_steps = 1)
  expect_identical(evaluate_policy(limited, c(1, 1, 1, 1))$mean_return, 0)
  expect_identical(evaluate_policy(limited, c(1, 1, 1, 1), max_steps = Inf)$mean_return, 1)
  expect_equal(evaluate_policy(walk_model(), c(1, 1, 1, 1), discount = 0.5)$mean_return, 0.5)
  # Exploring policies by the probabilities of what they draw.
  q <- cbind(0, c(1, 1, 1, 1))
  explores <- evaluate_policy(walk_model(), policy_table(q, epsilon = 1))
  expect_equal(explores$mean_return, 1 / 3)
  expect_error(evaluate_policy(walk_model(), list()), class = "gym_error_argument")
  half <- function(observation) observation / 2
  expect_error(evaluate_policy(walk_model(), half), "number of an action for each",
               class = "gym_error_argument")
})

# The best values, the same by both methods and by the policy itself.
expect_solved <- function(model, values, ...) {
  for (method in c("value_iteration", "policy_iteration")) {
    solved <- solve_mdp(model, method = method, ...)
    expect_equal(unname(solved$values), values, tolerance = 1e-9)
    own <- solve_mdp(model, policy = solved$policy, ...)
    expect_equal(own$start_value, solved$start_value, tolerance = 1e-9)
  }
}

model_of <- function(...) gym_model(data.frame(...), start = 0)

test_that("to stay for ever where no reward comes is worth 0, and no more", {
  # Going round in state 0 ties with what may win, but wins nothing.
  expect_solved(model_of(
    state = c(0, 0, 0, 1), action = c(0, 1, 1, 0), next_state = c(0, 2, 1, 1),
    probability = c(1, 0.5, 0.5, 1), reward = c(0, 1, 0, 0),
    terminated = c(FALSE, TRUE, FALSE, FALSE)
  ), c(0.5, 0, 0))
  # To end costs 1, to stay nothing.
  expect_solved(model_of(
    state = 0, action = c(0, 1), next_state = c(0, 1), reward = c(0, -1),
    terminated = c(FALSE, TRUE)
  ), c(0, 0))
  # A goal that is never left, as other packages write it.
  expect_solved(model_of(
    state = c(0, 0, 1), action = c(0, 1, 0), next_state = c(0, 1, 1), reward = c(-1, -1, 0)
  ), c(-1, 0))
})

test_that("a state without an end is worth -Inf, and does not keep the others from their values", {
  apart <- model_of(state = c(0, 2), action = 0, next_state = c(1, 2), reward = c(1, -1))
  expect_solved(apart, c(1, 0, -Inf))
  # Nobody goes there.
  choice <- model_of(state = c(0, 0, 1), action = c(0, 1, 0), next_state = c(1, 2, 1),
                     reward = c(100, 1, -1))
  expect_solved(choice, c(1, -Inf, 0))
})

test_that("a large number elsewhere makes no two actions equal", {
  expect_solved(model_of(
    state = c(0, 0, 1), action = c(0, 1, 0), next_state = 2, reward = c(1, 1.5, -1e9)
  ), c(1.5, -1e9, 0))
})

test_that("slow models are solved, too", {
  skip_unless_all()
  n <- 200
  walk <- data.frame(
    state = rep(seq_len(n - 1), each = 2), action = 0,
    next_state = rep(seq_len(n - 1), each = 2) + c(-1, 1), probability = 0.5, reward = 0
  )
  walk$reward[walk$next_state == n] <- 1
  solved <- solve_mdp(gym_model(walk, start = 100))
  expect_equal(unname(solved$values[-(n + 1)]), (0:(n - 1)) / n, tolerance = 1e-9)
  expect_solved(endless_model(-1), c(5, 0), discount = 0.9999)
})

test_that("what comes once does not decide the sign of what comes for ever", {
  model <- model_of(
    state = 0:2, action = 0, next_state = c(1, 1, 3), reward = c(5, -1, 0),
    terminated = c(FALSE, FALSE, TRUE)
  )
  expect_identical(unname(solve_mdp(model, policy = rep(0, 4))$values), c(-Inf, -Inf, 0, 0))
  both <- model_of(state = c(0, 0, 1, 2), action = 0, next_state = c(1, 2, 1, 2),
                   probability = c(0.5, 0.5, 1, 1), reward = c(0, 0, 1, -1))
  expect_identical(unname(solve_mdp(both, policy = rep(0, 3))$values), c(NaN, Inf, -Inf))
})

test_that("an undefined value makes no value undefined of a state that never gets there", {
  moves <- data.frame(
    state = c(0, 1, 2, 3, 3), action = 0, next_state = c(1, 0, 4, 2, 4),
    probability = c(1, 1, 1, 0.5, 0.5), reward = c(1, -1, 2, 4, 4)
  )
  moves$terminated <- moves$next_state == 4
  solved <- solve_mdp(gym_model(moves, start = 2), policy = policy_random())
  expect_identical(unname(solved$q[, 1]), c(NaN, NaN, 2, 5, -Inf))
})

test_that("a policy that draws its actions is not taken for one that does not", {
  draws <- function(state) sample(0:1, length(state), replace = TRUE)
  expect_error(evaluate_policy(walk_model(), draws), "draws its actions",
               class = "gym_error_draws")
  expect_error(solve_mdp(walk_model(), policy = draws), class = "gym_error_argument")
})

# The best values, the same by both methods and with a horizon.
expect_best <- function(table, values, actions, horizon = 30) {
  model <- gym_model(table, start = 0)
  for (given in list(list(method = "value_iteration"), list(method = "policy_iteration"),
                     list(horizon = horizon))) {
    solved <- rlang::exec(solve_mdp, model, !!!given)
    seen <- seq_along(values)
    expect_equal(unname(solved$values)[seen] / values, rep(1, length(values)), tolerance = 1e-11)
    expect_identical(as.matrix(solved$actions)[seen, 1L], actions)
  }
}

# A state that chooses among rewards, each of which ends the episode.
choice_table <- function(rewards) {
  data.frame(
    state = 0, action = seq_along(rewards) - 1, next_state = 1, reward = rewards
  )
}

test_that("a small difference between rewards is none of rounding, whatever their size", {
  expect_best(choice_table(c(0, 1e-10)), 1e-10, 1L)
  expect_best(choice_table(c(1e9, 1e9 + 0.5)), 1e9 + 0.5, 1L)
  expect_best(choice_table(c(-1e-10, -2e-10, -5e-11)), -5e-11, 2L)
  expect_best(choice_table(c(0, 1e-300)), 1e-300, 1L)
  # What is only rounding decides nothing.
  expect_best(choice_table(c(1e-9, 1e-9 * (1 + 1e-13))), 1e-9, 0L)
})

test_that("a rare event counts", {
  skip_unless_all()
  # Ten steps, each of which succeeds in one case of ten, or nothing.
  steps <- data.frame(
    state = rep(0:9, each = 3), action = c(0, 1, 1), probability = c(1, 0.1, 0.9),
    next_state = as.vector(rbind(11, 1:10, 11)), reward = 0
  )
  steps$reward[steps$next_state == 10] <- 1
  expect_best(steps, 0.1^(10:1), rep(1L, 10))
  # To win ends the episode hardly ever, to give up at once.
  rare <- data.frame(
    state = 0, action = c(0, 1, 1), probability = c(1, 1 - 1e-9, 1e-9), next_state = c(1, 0, 1),
    reward = c(0.9999, 0, 1)
  )
  for (method in c("value_iteration", "policy_iteration")) {
    expect_identical(solve_mdp(gym_model(rare, start = 0), method = method)$actions[[1L]], 1L)
  }
})

test_that("rewards of another size have values of that size, and the same best policy", {
  set.seed(1)
  random <- random_table(states = 12, actions = 3, successors = 3)
  random$reward[random$state == 3] <- 1e-8 * random$reward[random$state == 3]
  random$terminated <- random$next_state == 0
  random$reward[random$terminated] <- random$reward[random$terminated] + 3
  # A game that is fair in each step, and one that is so in three.
  fair <- data.frame(
    state = c(0, 0, 0, 1, 2, 3), action = c(0, 0, 1, 0, 0, 0),
    probability = c(0.25, 0.75, 1, 1, 1, 1), next_state = c(0, 0, 1, 2, 3, 4),
    reward = c(3, -1, 0.1, 0.2, -0.3, 0)
  )
  for (table in list(random, fair)) {
    for (given in list(
      list(), list(method = "policy_iteration"), list(discount = 0.9), list(horizon = 9),
      list(discount = 0.9, method = "policy_iteration")
    )) {
      plain <- rlang::exec(solve_mdp, gym_model(table, start = 0), !!!given)
      for (scale in c(1e-9, 1e9)) {
        scaled <- table
        scaled$reward <- scale * table$reward
        solved <- rlang::exec(solve_mdp, gym_model(scaled, start = 0), !!!given)
        expect_identical(solved$actions, plain$actions)
        expect_equal(solved$values / scale, plain$values, tolerance = 1e-12)
      }
    }
  }
})

test_that("an end that costs more than many sweeps is found", {
  skip_unless_all()
  expect_solved(model_of(
    state = 0, action = c(0, 1), next_state = c(0, 1), reward = c(-1, -30000)
  ), c(-30000, 0))
})

test_that("many states are solved as exactly as few", {
  skip_unless_all()
  set.seed(2)
  table <- random_table(states = 600, actions = 2, successors = 3)
  random <- gym_model(table, start = 0)
  exact <- function(actions, discount) {
    taken <- table[table$action == actions[table$state + 1L], ]
    moves <- stats::xtabs(probability ~ state + next_state, taken)
    moves <- unclass(moves)[, match(0:599, colnames(moves))]
    moves[is.na(moves)] <- 0
    rewards <- tapply(taken$probability * taken$reward, taken$state, sum)
    as.vector(solve(diag(600) - discount * moves, rewards))
  }
  for (method in c("value_iteration", "policy_iteration")) {
    solved <- solve_mdp(random, discount = 0.9, method = method)
    expect_equal(unname(solved$values), exact(solved$actions, 0.9), tolerance = 1e-12)
  }
  # So slow that its equations are solved.
  slow <- solve_mdp(random, policy = solved$policy, discount = 0.9999)
  expect_equal(unname(slow$values), exact(solved$actions, 0.9999), tolerance = 1e-11)
  # The gambler's ruin, Feller (1968), chapter XIV: most values are tiny.
  ruin <- solve_mdp(ruin_model(600, win = 0.4), method = "policy_iteration")
  theirs <- (1.5^(1:599) - 1) / (1.5^600 - 1)
  expect_equal(unname(ruin$values)[2:600] / theirs, rep(1, 599), tolerance = 1e-11)
})

test_that("a policy that never ends is told apart in a large model, too", {
  skip_unless_all()
  ring <- 601:1200
  model <- gym_model(data.frame(
    state = c(0, 0, 1:600, ring), action = 0, probability = c(0.5, 0.5, rep(1, 1200)),
    next_state = c(1, 601, 2:600, 1201, 602:1200, 601), reward = c(numeric(1000), 1, numeric(201))
  ), start = 0)
  values <- solve_mdp(model, policy = numeric(1202))$values
  expect_identical(unname(values[c(1, 2, 602, 1201, 1202)]), c(Inf, 0, Inf, Inf, 0))
})

test_that("what no memory holds is refused, with its number", {
  wide <- data.frame(
    state = 0, action = 0, next_state = c(1:299, 4e5), probability = 1 / 300, reward = 0
  )
  model <- gym_model(wide, start = 0)
  expect_error(solve_mdp(model), "needs tables of 120,000,300 numbers",
               class = "gym_error_argument")
  expect_error(solve_mdp(walk_model(), horizon = 1e8), "400,000,000 numbers",
               class = "gym_error_argument")
})

test_that("the names of a policy's actions and probabilities are used or refused", {
  chain <- gym_model(data.frame(
    state = c(0, 0, 1, 1), action = c(0, 1, 0, 1), next_state = c(1, 0, 0, 2),
    reward = c(1, 0, 0, 5), terminated = c(FALSE, FALSE, FALSE, TRUE)
  ), start = 0)
  value <- function(policy) solve_mdp(chain, policy, discount = 0.5)$start_value
  expected <- value(c(0, 1, 0))
  expect_identical(value(c("2" = 0, "1" = 1, "0" = 0)), expected)
  expect_error(value(c(a = 0, b = 1, c = 0)), "those of the states, `0`, `1`, `2`, not `a`",
               class = "gym_error_argument")
  p <- rbind(c(1, 0), c(0.2, 0.8), c(1, 0))
  mixed <- matrix(p, 3, dimnames = list(0:2, 0:1))[3:1, 2:1]
  expect_identical(value(mixed), value(p))
  expect_identical(value(`dimnames<-`(p, list(letters[1:3], c("go", "stay")))), value(p))
  expect_error(value(`colnames<-`(p, c("0", "stay"))), "those of the actions, `0`, `1`",
               class = "gym_error_argument")
})
