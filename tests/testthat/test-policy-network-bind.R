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

test_that("an output that has no range does not fit where it would be rounded", {
  skip_if_not_installed("sigmoid")
  policy <- policy_network(activation = c("tanh", "ReLU"))
  expect_error(policy_bind(policy, fake_environment()), "no upper end",
               class = "gym_error_argument")
})
