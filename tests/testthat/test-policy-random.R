test_that("actions are drawn from R's generator, uniformly over the action space", {
  policy <- policy_random(discrete_space(3L, start = 5L))
  set.seed(1)
  actions <- act(policy, matrix(0, 3000, 2))
  expect_type(actions, "integer")
  expect_identical(sort(unique(actions)), 5:7)
  expect_gt(chisq.test(table(actions))$p.value, 0.001)
  set.seed(1)
  expect_identical(act(policy, matrix(0, 3000, 2)), actions)
})

test_that("one observation gives one action, in the shape of the action space", {
  pendulum <- policy_random(box_space(-2, 2))
  action <- act(pendulum, c(1, 0, 0))
  expect_length(action, 1)
  expect_true(action >= -2 && action <= 2)
  square <- policy_random(box_space(rep(0, 6), rep(1, 6), shape = c(2L, 3L)))
  expect_identical(dim(act(square, 1)), c(2L, 3L))
})

test_that("many observations give as many actions", {
  expect_length(act(policy_random(discrete_space()), matrix(0, 5, 4)), 5)
  actions <- act(policy_random(box_space(c(-1, 9), c(1, 10))), matrix(0, 5, 4))
  expect_identical(dim(actions), c(5L, 2L))
  expect_true(all(actions[, 2] >= 9) && all(actions[, 1] <= 1))
  expect_identical(dim(act(policy_random(box_space(-1, 1)), matrix(0, 5, 4))), c(5L, 1L))
})

test_that("a policy without an action space says so, and takes that of the environment", {
  expect_error(act(policy_random(), 1:4), "has no action space",
               class = "gym_error_argument")
  env <- fake_environment(action_space = discrete_space(7L))
  bound <- policy_bind(policy_random(), env)
  expect_identical(bound$action_space, env$action_space)
})

test_that("a policy with actions that the environment does not have is refused", {
  env <- fake_environment(action_space = discrete_space(2L))
  expect_error(policy_bind(random_discrete_agent(3), env),
               "The policy's actions are <Discrete 3>, but Fake-v0 takes <Discrete 2>.",
               fixed = TRUE, class = "gym_error_argument")
  expect_error(policy_bind(policy_random(box_space(-1, 1)), env), class = "gym_error_argument")
  expect_identical(policy_bind(random_discrete_agent(1), env)$action_space$n, 1L)
})

test_that("the classic agent draws from n actions that begin at 0", {
  agent <- random_discrete_agent(3)
  set.seed(1)
  expect_identical(sort(unique(act(agent, matrix(0, 100, 1)))), 0:2)
  for (bad in list(0, -1, 1.5, NA, "two")) {
    expect_error(random_discrete_agent(bad), "`n` must be", class = "gym_error_argument")
  }
  expect_error(policy_random("CartPole-v1"), class = "gym_error_argument")
})

test_that("a random policy prints in one line", {
  expect_output(print(policy_random()), "<policy: random>", fixed = TRUE)
  expect_output(print(random_discrete_agent(2)), "<policy: random over <Discrete 2>>", fixed = TRUE)
})
