test_that("actions are numbers with what they mean, where that is known", {
  expect_identical(action_names("CartPole-v1", 2L), c("0: push left", "1: push right"))
  expect_identical(action_names("Unknown-v3", 2L), c("0", "1"))
  expect_identical(action_names(NULL, 2L, start = 5L), c("5", "6"))
  expect_identical(action_parts("Pendulum-v1", 1L), "torque")
  expect_identical(action_parts("Unknown-v3", 1L), "action")
  expect_identical(action_parts("Unknown-v3", 2L), c("action_1", "action_2"))
})

test_that("another number of actions than the documented one has no meaning", {
  expect_identical(action_names("CartPole-v1", 3L), c("0", "1", "2"))
  expect_identical(action_parts("LunarLander-v3", 2L), c("action_1", "action_2"))
})

test_that("there are as many meanings as the real environments have actions", {
  client <- test_client()
  for (id in c("Acrobot-v1", "Blackjack-v1", "CartPole-v1", "CliffWalking-v1", "FrozenLake-v1",
               "MountainCar-v0", "MountainCarContinuous-v0", "Pendulum-v1", "Taxi-v4")) {
    space <- local_env(id, client = client)$action_space
    meaning <- action_meanings[[environment_family(id)]]
    expect_identical(length(meaning), as.integer(space_width(space)), info = id)
  }
})

test_that("an action may be given by what it means, one or one for each sub-environment", {
  env <- local_env("CartPole-v1")
  steps <- lapply(list(1L, "push right", "1: push right"), function(action) {
    env$reset(seed = 1)
    env$step(action)
  })
  expect_identical(steps[2:3], steps[c(1, 1)])
  cnd <- expect_error(env$step("jump"), "no action \"jump\"", class = "gym_error_space")
  expect_match(conditionMessage(cnd), "0: push left, 1: push right", fixed = TRUE)
  both <- local_env("CartPole-v1", num_envs = 2)
  results <- lapply(list(c(0L, 1L), c("push left", "push right")), function(action) {
    both$reset(seed = 1)
    both$step(action)
  })
  expect_identical(results[[1]], results[[2]])
})

test_that("text is no action where the meaning of actions is not known", {
  env <- local_env("Blackjack-v1")
  env$reset(seed = 1)
  expect_error(env$step("1"), class = "gym_error_space")
  names <- list(spec = list(id = "Own-v0"), single_action_space = discrete_space(2L))
  expect_identical(numbered_actions(names, "1", NULL), "1")
})
