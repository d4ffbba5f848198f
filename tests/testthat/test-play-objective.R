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
  policy <- attr(objective, "policy")
  coef(policy) <- weights
  played <- rollout(env, policy, 3, seed = environment(objective)$seed)
  expect_identical(value, -mean(played$episodes$return))
  both <- objective(rbind(weights, rep(0, 4)))
  expect_identical(both, c(value, objective(rep(0, 4))))
  expect_identical(gym_objective(env, episodes = 3, seed = 5)(weights),
                   gym_objective(env, episodes = 3, seed = 5)(weights))
})

test_that("an objective is an optimiser's function", {
  objective <- gym_objective(fake_environment(reward = first_action), episodes = 2, seed = 1)
  set.seed(1)
  start <- coef(attr(objective, "policy"))
  found <- optim(start, objective, method = "SANN", control = list(maxit = 30))
  expect_lt(found$value, objective(start))
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
