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
