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

test_that("observations have the names of Gymnasium's documentation, in every version", {
  names_of <- function(env_id, n) observation_names(env_id, box_space(rep(-1, n), rep(1, n)))
  cart_pole <- c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity")
  expect_identical(names_of("CartPole-v0", 4), cart_pole)
  expect_identical(names_of("CartPole-v1", 4), cart_pole)
  expect_identical(names_of("MountainCarContinuous-v0", 2), c("position", "velocity"))
  expect_identical(names_of("LunarLanderContinuous-v3", 8), names_of("LunarLander-v3", 8))
  expect_identical(observation_names("Taxi-v4", discrete_space(500L)), "state")
})

test_that("unknown environments and changed observations have no names", {
  four <- box_space(rep(-1, 4), rep(1, 4))
  expect_null(observation_names("Unknown-v0", four))
  expect_null(observation_names(NULL, four))
  expect_null(observation_names("CartPole-v1", box_space(rep(-1, 5), rep(1, 5))))
  expect_null(observation_names("CartPole-v1", box_space(rep(-1, 4), rep(1, 4), shape = c(1L, 4L))))
  expect_null(observation_names("CartPole-v1", discrete_space(4L)))
})

test_that("there are as many names as the newest version of the environment shows numbers", {
  skip_unless_all()
  client <- test_client()
  known <- env_registry(client)
  known <- known[known$available, ]
  families <- vapply(known$id, environment_family, "")
  for (family in intersect(names(observation_parts), families)) {
    id <- known$id[max(which(families == family))]
    env <- gym_make(id, client = client)
    expect_identical(env$observation_space$names, observation_parts[[family]], info = id)
    env$close()
  }
})

test_that("observations of gym_make() have their names, alone and side by side", {
  parts <- observation_parts$CartPole
  env <- local_env()
  expect_named(env$reset(), parts)
  expect_named(env$reset(return_info = TRUE)$observation, parts)
  expect_named(env$step(1)$observation, parts)
  two <- local_env(num_envs = 2, vectorization_mode = "sync", autoreset_mode = "Disabled")
  expect_identical(dimnames(two$reset()), list(NULL, parts))
  expect_identical(dimnames(two$reset(return_info = TRUE)$observation), list(NULL, parts))
  out <- two$step(c(0, 1))
  expect_identical(dimnames(out$observation), list(NULL, parts))
  expect_identical(dimnames(two$step(1, which = 2)$observation), list(NULL, parts))
  expect_identical(out$observation[, "pole_angle"], out$observation[, 3])
})

test_that("the parts of a Tuple have their names, a single number has none", {
  parts <- c("player_sum", "dealer_card", "usable_ace")
  for (n in list(NULL, 2)) {
    env <- local_env("Blackjack-v1", num_envs = n, autoreset_mode = if (!is.null(n)) "SameStep")
    expect_named(env$reset(seed = 1), parts)
    out <- env$step(rep(1, n %||% 1))
    expect_named(out$observation, parts)
  }
  # Both have drawn too many cards by then.
  for (i in 1:9) {
    out <- env$step(c(1, 1))
    for (final in out$info$final_obs) if (!is.null(final)) expect_named(final, parts)
    expect_named(out$next_observation, parts)
  }
  lake <- local_env("FrozenLake-v1")
  expect_identical(lake$reset(), 0L)
  expect_identical(lake$observation_space$names, "position")
})

test_that("the observations of the classic calls have no names", {
  for (n in list(NULL, 2)) {
    env <- local_env(num_envs = n)
    blackjack <- local_env("Blackjack-v1", num_envs = n)
    client <- env$client
    expect_null(attributes(env_reset(client, env$instance_id))$names)
    expect_null(attributes(env_reset(client, env$instance_id))$dimnames)
    out <- env_step(client, env$instance_id, rep(1, n %||% 1))
    expect_null(names(out$observation))
    expect_null(dimnames(out$observation))
    expect_null(dimnames(out$next_observation))
    expect_null(names(env_reset(client, blackjack$instance_id)))
  }
})

test_that("where a wrapper changes what is observed, names are lost", {
  names_of <- function(wrapped) names(local_env(wrapped)$reset())
  parts <- observation_parts$MountainCar
  car <- function(...) gym_wrap("MountainCar-v0", ...)
  expect_identical(names_of(car("TimeLimit", max_episode_steps = 5)), parts)
  expect_identical(names_of(car("DelayObservation", delay = 1)), parts)
  expect_null(names_of(car("NormalizeObservation")))
  expect_null(names_of(car("RescaleObservation", min_obs = 0, max_obs = 1)))
  expect_null(names_of(car("TimeAwareObservation")))
  # One of these frames has two numbers, but there are two frames.
  expect_null(dimnames(local_env(car("FrameStackObservation", stack_size = 2))$reset()))
})

test_that("an observation with names is sent back as one without", {
  for (n in list(NULL, 2)) {
    for (id in c("CartPole-v1", "Blackjack-v1")) {
      env <- local_env(id, num_envs = n)
      observed <- env$reset()
      expect_true(space_contains(env$observation_space, observed))
      expect_true(env_observation_space_contains(env$client, env$instance_id, observed))
    }
  }
  # A number taken out of an observation keeps its name, and is an action all the same.
  pendulum <- local_env("Pendulum-v1")
  other <- local_env("Pendulum-v1")
  observed <- pendulum$reset(seed = 1)
  other$reset(seed = 1)
  expect_identical(pendulum$step(observed["sin_theta"]), other$step(unname(observed)[2]))
  poles <- local_env("CartPole-v1", num_envs = 1)
  expect_identical(poles$step((poles$reset(seed = 1) > 9)[, "pole_angle"])$reward, 1)
})

# Units and limits ------------------------------------------------------------------------

test_that("labels have the documented units, and unknown names stay as they are", {
  cart_pole <- observation_parts$CartPole
  expect_identical(
    observation_labels("CartPole-v0", cart_pole),
    c("cart position (m)", "cart velocity (m/s)", "pole angle (rad)",
      "pole angular velocity (rad/s)")
  )
  expect_identical(observation_labels("CartPole-v1", c("reward", "obs_1")), c("reward", "obs_1"))
  expect_identical(observation_labels("Unknown-v0", c("pole_angle", "obs_1")),
                   c("pole_angle", "obs_1"))
  expect_identical(observation_labels("Taxi-v4", "state"), "state")
  expect_identical(observation_labels("Pendulum-v1", c("cos_theta", "angular_velocity")),
                   c("cos theta", "angular velocity (rad/s)"))
  expect_identical(observation_labels(NULL, "obs_1"), "obs_1")
})

test_that("units and limits are of parts that there are", {
  for (family in names(observation_units)) {
    expect_true(all(names(observation_units[[family]]) %in% observation_parts[[family]]))
  }
  for (family in names(episode_limits)) {
    expect_true(all(names(episode_limits[[family]]) %in% observation_parts[[family]]))
    for (limit in episode_limits[[family]]) {
      expect_true(limit$kind %in% names(limit_colours))
    }
  }
})

test_that("CartPole: no episode goes on beyond its limits", {
  limits <- episode_limits$CartPole
  played <- rollout("CartPole-v1", policy_random(), 300, seed = 1, steps = TRUE,
                    client = test_client())
  right <- function(observation) rep(1L, nrow(observation))
  steps <- rbind(
    played$steps,
    rollout("CartPole-v1", right, 300, seed = 1, steps = TRUE, client = test_client())$steps
  )
  expect_true(all(abs(steps$pole_angle) <= limits$pole_angle$at[2]))
  # And up to there they do.
  expect_gt(max(abs(steps$pole_angle)), 0.98 * limits$pole_angle$at[2])
  expect_true(all(abs(steps$cart_position) <= limits$cart_position$at[2]))
})
