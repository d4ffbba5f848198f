by_seed <- function(seed, step, action) seed %% 10 + 5 * action

test_that("an evaluation is the mean of the returns, with the interval of a t test", {
  evaluation <- evaluate_policy(fake_environment(reward = by_seed), policy_random(), 20, seed = 1)
  returns <- rollout(fake_environment(reward = by_seed), policy_random(), 20, seed = 1)$episodes
  test <- t.test(returns$return)
  expect_s3_class(evaluation, c("gym_evaluation", "data.frame"), exact = TRUE)
  expect_identical(
    vapply(evaluation, typeof, ""),
    c(candidate = "integer", mean_return = "double", se = "double", lower = "double",
      upper = "double", episodes = "integer", steps = "integer")
  )
  expect_identical(evaluation$mean_return, mean(returns$return))
  expect_equal(evaluation$se, test$stderr)
  expect_equal(c(evaluation$lower, evaluation$upper), as.vector(test$conf.int))
  expect_identical(c(evaluation$candidate, evaluation$episodes), c(1L, 20L))
  expect_identical(evaluation$steps, sum(returns$length))
  wide <- evaluate_policy(fake_environment(reward = by_seed), policy_random(), 20, seed = 1,
                          level = 0.99)
  expect_equal(c(wide$lower, wide$upper), as.vector(t.test(returns$return, conf.level = 0.99)$conf))
})

test_that("every policy of a list has a row under its name, and plays the same seeds", {
  left <- function(observation) rep(0L, nrow(observation))
  right <- function(observation) rep(1L, nrow(observation))
  env <- fake_vector_env(4, reward = by_seed)
  evaluation <- evaluate_policy(env, list(left = left, right = right), 8, seed = 1)
  expect_identical(row.names(evaluation), c("left", "right"))
  expect_identical(evaluation$candidate, 1:2)
  # Three steps, each with 5 more for the action 1: with other seeds it would be another difference.
  expect_equal(diff(evaluation$mean_return), 15)
  expect_equal(diff(evaluation$se), 0)
  expect_identical(row.names(evaluate_policy(env, list(left, right), 2, seed = 1)), c("1", "2"))
})

test_that("a matrix of weights has a row for each candidate, as if played alone", {
  policy <- policy_network(c(4, 1))
  weights <- withr::with_seed(1, matrix(runif(40, -1, 1), 10))
  env <- fake_vector_env(4, reward = by_seed)
  together <- evaluate_policy(env, policy_candidates(policy, weights), 6, seed = 1)
  expect_identical(together$candidate, 1:10)
  expect_gt(length(unique(together$mean_return)), 1)
  for (i in 1:10) {
    coef(policy) <- weights[i, ]
    alone <- evaluate_policy(env, policy, 6, seed = 1)
    expect_equal(together$mean_return[i], alone$mean_return)
    expect_equal(together$se[i], alone$se)
  }
})

test_that("a single episode has a mean and no interval, equal returns have none to speak of", {
  one <- evaluate_policy(fake_environment(), policy_random(), 1, seed = 1)
  expect_identical(one$mean_return, 3)
  expect_identical(c(one$se, one$lower, one$upper), rep(NA_real_, 3))
  equal <- evaluate_policy(fake_environment(), policy_random(), 5, seed = 1)
  expect_identical(c(equal$se, equal$lower, equal$upper), c(0, 3, 3))
})

test_that("parts of the table print, too", {
  evaluation <- evaluate_policy(fake_environment(), list(a = policy_random(), b = policy_random()),
                                5, seed = 1)
  expect_output(print(evaluation["b", ]), "Evaluation in Fake-v0: 5 episodes")
  expect_output(print(evaluation["se"]), "se\na +0")
  expect_output(print(evaluation[1, c("candidate", "steps")]), "candidate steps")
  evaluation$steps <- NULL
  expect_output(print(evaluation), "mean_return se lower upper episodes\n")
})

test_that("the environment's own arguments and limits of steps go along", {
  client <- test_client()
  way <- c(2L, 2L, 1L, 0L, 1L, 0L, 1L, 0L, 2L, 1L, 1L, 0L, 0L, 2L, 2L)
  to_goal <- function(observation) way[observation + 1L]
  sure <- evaluate_policy("FrozenLake-v1", to_goal, 3, seed = 1, is_slippery = FALSE,
                          client = client)
  expect_identical(c(sure$mean_return, sure$steps), c(1, 18))
  expect_warning(
    short <- evaluate_policy("FrozenLake-v1", to_goal, 3, seed = 1, is_slippery = FALSE,
                             max_steps = 5, num_envs = 2, client = client),
    NA
  )
  expect_identical(c(short$mean_return, short$steps), c(0, 15))
})

test_that("what is wrong is refused before anything is made", {
  evaluate <- function(...) evaluate_policy("CartPole-v1", ..., client = no_client())
  for (level in list(0, 1, 95, NA, "0.95", c(0.9, 0.95))) {
    expect_error(evaluate(policy_random(), level = level),
                 "`level` must be a number between 0 and 1", class = "gym_error_argument")
  }
  expect_error(evaluate(policy_random(), episodes = 0), "`episodes` must be a whole number",
               class = "gym_error_argument")
  expect_error(evaluate("random"), "`policy` must be a policy", class = "gym_error_argument")
  expect_error(evaluate(list()), "`policy` must be a policy, or a list of at least one",
               class = "gym_error_argument")
})

test_that("an objective is minus the mean return, of the same episodes each time", {
  env <- fake_environment(reward = first_action)
  set.seed(1)
  objective <- gym_objective(env, episodes = 3)
  before <- .Random.seed
  weights <- c(1, -1, 0.5, 2)
  value <- objective(weights)
  expect_identical(objective(weights), value)
  expect_identical(.Random.seed, before)
  seeds <- env$seeds
  expect_identical(seeds[1:3], seeds[4:6])
  policy <- attr(objective, "policy")
  coef(policy) <- weights
  played <- rollout(env, policy, 3, seed = environment(objective)$seed)
  expect_identical(value, -mean(played$episodes$return))
  both <- objective(rbind(weights, rep(0, 4)))
  expect_identical(both, c(value, objective(rep(0, 4))))
  expect_identical(gym_objective(env, episodes = 3, seed = 5)(weights),
                   gym_objective(env, episodes = 3, seed = 5)(weights))
})

test_that("candidates play the same episodes side by side as each by itself", {
  for (env in list(fake_vector_env(4, "sync", reward = first_action),
                   fake_vector_env(7, "vector_entry_point", reward = first_action))) {
    objective <- gym_objective(env, episodes = 3, seed = 1)
    weights <- rbind(1:4, c(-1, 1, -1, 1), -(1:4))
    each <- apply(weights, 1L, objective)
    expect_identical(objective(weights), each)
    expect_gt(length(unique(each)), 1)
  }
})

test_that("simulated annealing draws its own numbers around an objective", {
  skip_unless_all()
  objective <- gym_objective(fake_environment(reward = first_action), episodes = 4, seed = 1)
  start <- coef(attr(objective, "policy"))
  asked <- list()
  watched <- function(weights) {
    asked[[length(asked) + 1L]] <<- weights
    objective(weights)
  }
  set.seed(1)
  kinds <- RNGkind()
  found <- optim(start, watched, method = "SANN", control = list(maxit = 50))
  expect_lt(found$value, objective(start))
  expect_identical(RNGkind(), kinds)
  set.seed(1)
  still <- list()
  plain <- function(weights) {
    still[[length(still) + 1L]] <<- weights
    objective_values[[length(still)]]
  }
  objective_values <- vapply(asked, objective, 0)
  set.seed(1)
  optim(start, plain, method = "SANN", control = list(maxit = 50))
  # The same proposals as around a function that plays nothing.
  expect_identical(asked, still)
  expect_output(print(objective), "<objective: minus the mean return of network 4-1, identity",
                fixed = TRUE)
})

test_that("what makes no objective is refused", {
  env <- fake_environment()
  refused <- function(code) expect_error(code, class = "gym_error_argument")
  refused(gym_objective(env, policy_random()))
  refused(gym_objective(env, episodes = 0))
  refused(gym_objective(env, seed = 0.5))
  refused(gym_objective(env, policy_network(c(3, 1))))
  refused(gym_objective(env)(1:3))
  refused(gym_objective(env)(c(1, NA, 1, 1)))
})
