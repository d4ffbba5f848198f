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

# An environment in R that returns the action that it got.
echo_env <- function(action_space, ...) {
  gym_env(
    reset = function(self) c(0, 0),
    step = function(self, action) {
      list(observation = rep_len(as.numeric(unlist(action)), 2), reward = 0, terminated = FALSE)
    },
    observation_space = space_box(c(-9, -9), 9), action_space = action_space, ...
  )
}

test_that("names of an action are used or refused, where environments in R take it", {
  counted <- new_space(list(
    name = "MultiDiscrete", shape = list(2L), dtype = "int64", nvec = list(3L, 3L)
  ))
  own <- space_box(c(steer = -1, gas = -1), 1)
  taken <- function(space, action) {
    env <- echo_env(space)
    env$reset()
    env$step(action)$observation
  }
  for (space in list(space_box(c(-1, -1), 1), counted)) {
    expect_identical(taken(space, c(1, 0)), c(1, 0))
    expect_identical(taken(space, c(action_2 = 0, action_1 = 1)), c(1, 0))
    expect_error(taken(space, c(b = 1, a = 0)), "are .*`action_1`, `action_2`, not `b`, `a`",
                 class = "gym_error_space")
  }
  expect_identical(taken(own, c(gas = 0, steer = 1)), c(1, 0))
  expect_identical(taken(own, c(action_gas = 0, action_steer = 1)), c(1, 0))
  expect_error(taken(own, c(gas = 0, brake = 1)), "`steer`, `gas`, or `action_steer`",
               class = "gym_error_space")
  pair <- space_tuple(space_discrete(3), space_discrete(3))
  expect_identical(taken(pair, list(action_2 = 0, action_1 = 1)), c(1, 0))
  expect_error(taken(pair, list(b = 0, a = 1)), "not `b`, `a`", class = "gym_error_space")
  nested <- space_dict(arm = own)
  expect_identical(taken(nested, list(arm = c(gas = 0, steer = 1))), c(1, 0))
  expect_error(taken(nested, list(arm = c(b = 0, a = 1))), "not `b`, `a`",
               class = "gym_error_space")
  # The name of a single number is a label.
  expect_identical(taken(space_box(-1, 1), c(torque = 1))[[1]], 1)
})

test_that("names of an action are used or refused, where a server takes it", {
  env <- local_env("LunarLanderContinuous-v3")
  both <- local_env("LunarLanderContinuous-v3", num_envs = 2)
  step <- function(action, env) {
    env$reset(seed = 1)
    env$step(action)$observation
  }
  ordered <- c(1, -0.7)
  named <- c("side engines" = -0.7, "main engine" = 1)
  expect_identical(step(named, env), step(ordered, env))
  expect_error(step(c(b = 1, a = 0), env), "`main engine`, `side engines`",
               class = "gym_error_space")
  expect_identical(step(rbind(named, named), both), step(rbind(ordered, ordered), both))
  expect_error(step(cbind(b = c(1, 1), a = 0), both), "not `b`, `a`", class = "gym_error_space")
})

test_that("the columns of a policy's actions are taken by name, and kept in that order", {
  env <- echo_env(space_box(c(steer = -1, gas = -1), 1), max_episode_steps = 2)
  play <- function(act) rollout(env, act, seed = 1, steps = TRUE)$steps
  named <- play(function(observation) cbind(gas = rep(0.5, nrow(observation)), steer = 1))
  expect_identical(named, play(function(observation) cbind(rep(1, nrow(observation)), 0.5)))
  expect_identical(named$action_steer, c(1, 1))
  expect_error(play(function(observation) cbind(a = observation[, 1], b = 0)), "not `a`, `b`",
               class = "gym_error_space")
  # cbind() makes names, which are labels where none are known.
  bare <- echo_env(space_box(c(-1, -1), 1), max_episode_steps = 2)
  steps <- rollout(bare, function(observation) {
    first <- rep(1, nrow(observation))
    cbind(first, second = 0.5)
  }, seed = 1, steps = TRUE)$steps
  expect_identical(steps$action_1, c(1, 1))
  expect_error(rollout(bare, function(observation) cbind(action_1 = observation[, 1], b = 0)),
               "not `action_1`, `b`", class = "gym_error_space")
  data <- data.frame(obs_1 = c(0, 1, 2), a = c(0, 0.1, 0.2), b = 0.5)
  fit <- lm(cbind(action_2 = a, action_1 = b) ~ obs_1, data)
  expect_equal(rollout(bare, as_policy(fit), seed = 1, steps = TRUE)$steps$action_1[[1]], 0.5)
  drawing <- policy_bind(policy_network(c(2, 2), output = "gaussian"), bare)
  action <- c(action_2 = 0.3, action_1 = 0.1)
  expect_identical(policy_log_prob(drawing, c(1, 1), action),
                   policy_log_prob(drawing, c(1, 1), c(0.1, 0.3)))
})
