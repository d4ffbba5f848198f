test_that("a model plays as an environment, at the rates of its table", {
  table <- data.frame(
    state = 0, action = c(0, 0, 1), next_state = c(0, 1, 2), reward = c(1, 10, 3),
    probability = c(0.75, 0.25, 1)
  )
  model <- gym_model(table, start = 0, id = "Coin")
  policy <- policy_table(rbind(c(1, 0), c(0, 0), c(0, 0)))
  exact <- evaluate_policy(model, policy)
  expect_equal(exact$mean_return, 3 + 10)
  played <- rollout(model, policy, episodes = 4000, seed = 1)
  expect_lt(abs(mean(played$episodes$return) - 13), 4 * stats::sd(played$episodes$return) / 63)
  expect_true(all(played$episodes$terminated))
  expect_identical(rollout(model, policy, episodes = 4000, seed = 1), played)
  expect_identical(played$env_id, "Coin")
})

test_that("rewards, ends and starts are those of the table", {
  model <- gym_model(walk_table(), start = c(0, 0.25, 0.75, 0))
  played <- rollout(model, policy_random(), episodes = 4000, seed = 2, steps = TRUE,
                    next_observation = TRUE)
  seen <- unique(played$steps[c("obs_1", "action", "next_obs_1", "reward", "terminated")])
  names(seen) <- c("state", "action", "next_state", "reward", "terminated")
  seen <- seen[order(seen$state, seen$action), ]
  row.names(seen) <- NULL
  expect_identical(seen, as.data.frame(model)[names(seen)])
  first <- played$steps$obs_1[played$steps$step == 1]
  expect_lt(abs(mean(first == 2) - 0.75), 4 * sqrt(0.75 * 0.25 / 4000))
})

test_that("a model is cut off after its limit", {
  model <- gym_model(
    data.frame(state = 0, action = 0, next_state = 0, reward = 1), max_episode_steps = 12
  )
  played <- rollout(model, function(state) rep(0L, length(state)), episodes = 3, seed = 1)
  expect_identical(played$episodes$length, rep(12L, 3))
  expect_true(all(played$episodes$truncated))
})

test_that("a single environment is reset and stepped", {
  env <- model_env(walk_model())
  expect_identical(env$reset(seed = 1), 1L)
  result <- env$step(1)
  expect_identical(result[c("observation", "reward", "terminated")],
                   list(observation = 2L, reward = 0, terminated = FALSE))
  expect_true(env$step(1)$terminated)
  expect_identical(as.data.frame(env_model(env)), as.data.frame(walk_model()))
  expect_error(model_env(3), class = "gym_error_argument")
})

test_that("an action that a state does not have is an error by name", {
  env <- model_env(gym_model(walk_table()[-3, ], start = 2))
  env$reset(seed = 1)
  expect_error(env$step(0), "Action 0 cannot be taken in state 2 of R-model")
})

test_that("probabilities that are tiny, or 0, are drawn as such", {
  table <- data.frame(
    state = 0, action = 0, next_state = 1:4, reward = 0,
    probability = c(0, 1e-9, 1 - 1e-9, 0)
  )
  played <- rollout(gym_model(table), function(state) rep(0L, length(state)), episodes = 2000,
                    seed = 1, steps = TRUE, next_observation = TRUE)
  expect_identical(unique(played$steps$next_obs_1), 3L)
})

test_that("a model whose episodes have no end is played with a limit of steps only", {
  # The end cannot be reached from the start.
  ring <- gym_model(data.frame(
    state = c(0, 1, 2), action = 0, next_state = c(1, 0, 3), reward = 1
  ), start = 0, id = "Ring")
  for (play in list(
    function(...) rollout(ring, policy_random(), seed = 1, ...),
    function(...) learn_q(ring, iterations = 1, seed = 1, ...)
  )) {
    expect_error(play(), "Episodes of Ring never end.*max_steps", class = "gym_error_argument")
    expect_no_error(play(max_steps = 5))
  }
  limited <- gym_model(as.data.frame(ring), start = 0, max_episode_steps = 3)
  expect_identical(rollout(limited, policy_random(), seed = 1)$episodes$length, 3L)
  expect_no_error(rollout(walk_model(), policy_random(), seed = 1))
})

test_that("at random a model is played with the actions that a state has", {
  # In state 1 there is only action 1, in state 2 only 0 and 2.
  table <- data.frame(
    state = c(0, 0, 0, 1, 2, 2), action = c(0, 1, 2, 1, 0, 2),
    next_state = c(1, 2, 3, 2, 3, 3), reward = c(0, 1, 2, 4, 8, 16)
  )
  model <- gym_model(table, start = 0, id = "Few")
  played <- rollout(model, policy_random(), episodes = 3000, seed = 1, steps = TRUE)
  expect_setequal(played$steps$action[played$steps$obs_1 == 1], 1)
  expect_equal(mean(played$steps$action[played$steps$obs_1 == 2] == 0), 0.5, tolerance = 0.1)
  exact <- evaluate_policy(model, policy_random())$mean_return
  returns <- played$episodes$return
  expect_lt(abs(mean(returns) - exact), 4 * stats::sd(returns) / sqrt(length(returns)))
})
