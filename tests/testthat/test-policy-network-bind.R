test_that("sizes that do not fit the environment are refused with both numbers", {
  env <- fake_environment(id = "CartPole-v1")
  expect_error(policy_bind(policy_network(c(3, 2, 1)), env),
               "The network takes 3 inputs, but an observation of CartPole-v1 has 4 numbers.",
               fixed = TRUE, class = "gym_error_argument")
  expect_error(policy_bind(policy_network(c(3, 2, 1)), env), "sizes = c(4, 2, 1)", fixed = TRUE)
  expect_error(policy_bind(policy_network(c(4, 2, 3)), env),
               "The network gives 3 outputs, but CartPole-v1 has 2 actions.",
               fixed = TRUE, class = "gym_error_argument")
  three <- fake_environment(action_space = discrete_space(3L))
  expect_error(policy_bind(policy_network(c(4, 2, 1)), three), "gives 1 output, but Fake-v0 has 3")
  pendulum <- fake_environment(action_space = box_space(-2, 2))
  expect_error(policy_bind(policy_network(c(4, 2)), pendulum),
               "The network gives 2 outputs, but Fake-v0 takes an action of 1 number.",
               fixed = TRUE)
  expect_identical(policy_bind(policy_network(c(4, 2)), env)$action_space, env$action_space)
})

test_that("a Box with a side without a bound is refused", {
  env <- fake_environment(action_space = box_space(-1, 1e100))
  expect_error(policy_bind(policy_network(), env), "side without a bound",
               class = "gym_error_argument")
})

test_that("outputs without a range need no bounds", {
  env <- fake_environment(action_space = box_space(c(-1, -Inf), c(1e100, 2)))
  policy <- policy_bind(policy_linear(weights = rbind(c(1, 0, 0, 0), c(0, 1, 0, 0))), env)
  expect_identical(act(policy, rbind(c(-3, -9, 0, 0), c(5, 8, 0, 0))), rbind(c(-1, -9), c(5, 2)))
})

test_that("sizes that are the environment's own are taken from it", {
  three <- fake_environment(action_space = discrete_space(3L))
  box <- fake_environment(action_space = box_space(c(-1, -1), c(1, 1)))
  expect_identical(policy_bind(policy_linear(), fake_environment())$sizes, c(4L, 1L))
  expect_identical(policy_bind(policy_linear(), three)$weights, list(matrix(0, 3, 4)))
  expect_identical(policy_bind(policy_linear(bias = TRUE), box)$weights, list(matrix(0, 2, 5)))
  expect_identical(policy_bind(policy_network(c(NA, 5, NA)), three)$sizes, c(4L, 5L, 3L))
  expect_identical(policy_bind(policy_network(c(NA, 5, 1)), fake_environment())$sizes,
                   c(4L, 5L, 1L))
  expect_error(policy_bind(policy_network(c(NA, 5, 2)), three), "has 3 actions",
               class = "gym_error_argument")
  expect_error(policy_bind(policy_linear(), fake_environment(action_space = space_text(3))),
               "cannot choose from", class = "gym_error_argument")
})

test_that("weights of unknown sizes are drawn once, by the generator's state of then", {
  set.seed(1)
  policy <- policy_network(c(NA, 2, NA))
  again <- policy_network(c(NA, 2, NA))
  expect_null(policy$weights)
  before <- .Random.seed
  bound <- policy_bind(policy, fake_environment())
  expect_identical(.Random.seed, before)
  expect_identical(bound$weights, policy_bind(policy, fake_environment())$weights)
  expect_false(identical(bound$weights, policy_bind(again, fake_environment())$weights))
  expect_identical(lapply(bound$weights, dim), list(c(2L, 4L), c(1L, 2L)))
  set.seed(1)
  expect_identical(policy_network(c(NA, 2, NA)), policy)
  # Bound to another environment afterwards it keeps its sizes.
  expect_error(policy_bind(bound, fake_environment(action_space = discrete_space(3L))),
               class = "gym_error_argument")
})

test_that("a network without sizes says how to get them", {
  for (f in list(function(p) act(p, 1:4), coef, plot,
                 function(p) policy_candidates(p, matrix(0, 2, 4)))) {
    expect_error(f(policy_linear()), "does not know its sizes: *-*", fixed = TRUE,
                 class = "gym_error_argument")
  }
})

test_that("only numbers of a range are normalized", {
  env <- fake_environment(observation_space = discrete_space(3L))
  expect_error(policy_bind(policy_linear(normalize = TRUE), env), "normalize = FALSE",
               class = "gym_error_argument")
})
