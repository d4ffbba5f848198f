test_that("a result of each kind says where it comes from", {
  env <- fake_environment(reward = first_action)
  results <- list(
    rollout(env, policy_random(), seed = 4),
    evaluate_policy(env, policy_random(), 3, seed = 4),
    search_random(env, rounds = 2, seed = 4),
    train_agent(agent_hill_climb(), env, iterations = 1, eval_episodes = 2, seed = 4)
  )
  for (result in results) {
    from <- provenance(result)
    expect_s3_class(from, "gym_provenance")
    expect_identical(from$seed, 4)
    expect_identical(from$env_id, "Fake-v0")
    expect_identical(from$R, as.character(getRversion()))
    expect_identical(from$gym, as.character(utils::packageVersion("gym")))
    expect_null(from$server)
  }
  for (result in results[3:4]) {
    expect_s3_class(provenance(result)$started, "POSIXct")
    expect_identical(provenance(result)$elapsed, result$elapsed)
  }
  repeated <- provenance(search_random(env, rounds = 2, target = 1, seeds = c(7, 9)))
  expect_identical(repeated$seed, c(7, 9))
})

test_that("the server's versions and the environment's arguments and wrappers are among it", {
  client <- test_client()
  env <- gym_make(gym_wrap("FrozenLake-v1", "TimeLimit", max_episode_steps = 5),
                  is_slippery = FALSE, client = client)
  from <- provenance(rollout(env, policy_random(), seed = 1))
  env$close()
  expect_named(from$server, c("gym_server", "gymnasium", "numpy", "python"), ignore.order = TRUE)
  expect_identical(from$kwargs, list(is_slippery = FALSE))
  expect_identical(from$wrappers, "TimeLimit")
  by_id <- rollout("FrozenLake-v1", policy_random(), seed = 1, map_name = "8x8", client = client)
  expect_identical(provenance(by_id)$kwargs, list(map_name = "8x8"))
  lines <- format(provenance(by_id))
  expect_match(lines, "^arguments: +map_name 8x8$", all = FALSE)
  expect_match(lines, "^server: .*gymnasium [0-9]", all = FALSE)
})

test_that("a checkpoint has that of what it keeps", {
  path <- local_checkpoint()
  env <- fake_environment()
  trained <- train_agent(agent_cem(4), env, iterations = 1, eval_episodes = 2, seed = 3,
                         checkpoint = path)
  expect_identical(provenance(path)$started, provenance(trained)$started)
  expect_identical(provenance(path)$seed, 3)
  search_random(env, rounds = 2, seed = 8, checkpoint = path, resume = FALSE)
  expect_identical(provenance(path)$seed, 8)
  # What went on from a file is as old as its beginning.
  suppressMessages(again <- search_random(env, rounds = 2, seed = 8, checkpoint = path))
  expect_identical(provenance(again)$started, provenance(path)$started)
})

test_that("what has no provenance is refused", {
  expect_error(provenance(3), "`x` must be a result", class = "gym_error_argument")
  expect_error(provenance(mtcars), class = "gym_error_argument")
  expect_error(provenance("no-such-file.rds"), "no-such-file", class = "gym_error_argument")
})

test_that("the same call gives the same rollout, its provenance included", {
  play <- function() rollout(fake_environment(), policy_random(), 3, seed = 1)
  expect_identical(play(), play())
})

test_that("the engine that simulates an environment is named with its version", {
  play <- function(policy) {
    provenance(rollout("LunarLander-v3", policy, seed = 1, max_steps = 2, client = test_client()))
  }
  beside <- play(policy_random())
  expect_match(beside$server$Box2D, "^[0-9.]+$")
  expect_identical(play(function(observation) 0)$server$Box2D, beside$server$Box2D)
  expect_match(format(beside), "^server: .*Box2D [0-9]", all = FALSE)
})

test_that("a search prints in under ten lines what came of it", {
  search <- search_random(scripted_environment(c(1, 2, 30)), rounds = 3, episodes = 1, target = 20)
  lines <- capture.output(print(search))
  expect_lt(length(lines), 10)
  expect_match(lines[1], "Training in Fake-v0 by random search", fixed = TRUE)
  expect_match(lines[2], "network 4-2-1, tanh, logistic, 10 weights", fixed = TRUE)
  expect_match(lines[3], "^Solved after 3 rounds, 3 steps in .* \\(target 20\\)$")
  expect_identical(lines[4], "Best of 3 rounds: round 3, mean return 30 in 1 episode")
  search <- search_random(scripted_environment(c(1, 4, 2)), rounds = 3, episodes = 1, target = 20)
  expect_output(print(search), "Played 3 rounds, 3 steps")
  expect_output(print(search), "Best of 3 rounds: round 2, mean return 4")
})

test_that("predicting gives actions or the outputs behind them, and leaves the generator alone", {
  search <- search_random(fake_environment(id = "CartPole-v1"), rounds = 2, seed = 1)
  set.seed(1)
  observations <- matrix(rnorm(40), ncol = 4)
  state <- .Random.seed
  actions <- predict(search, observations)
  outputs <- predict(search, observations, type = "output")
  expect_identical(.Random.seed, state)
  expect_identical(actions, act(search$policy, observations))
  expect_identical(actions, as.integer(round(outputs)))
  expect_identical(predict(search, observations[3, ]), actions[3])
  expect_error(predict(search, observations, type = "weights"), "`type`",
               class = "gym_error_argument")
})

test_that("predicting finds the observations among the columns of played steps", {
  env <- fake_environment(id = "CartPole-v1")
  search <- search_random(env, rounds = 2, seed = 1)
  played <- rollout(env, search$policy, episodes = 5, steps = TRUE)
  expect_identical(predict(search, played$steps), played$steps$action)
  expect_identical(predict(played, rev(played$steps)), played$steps$action)
  expect_identical(predict(search, unname(played$steps[3:6])), played$steps$action)
  expect_error(predict(search, played$steps[1:5]), "it has no `pole_angular_velocity`",
               class = "gym_error_argument")
  random <- rollout(env, policy_random(), steps = TRUE)
  expect_error(predict(random, random$steps), "needs the policy to be a network",
               class = "gym_error_argument")
})

test_that("a summary plays the policy found in fresh episodes", {
  skip_unless_all()
  env <- fake_environment(reward = first_action)
  search <- search_random(env, rounds = 3, episodes = 2, target = 12, seed = 1)
  summary <- summary(search, episodes = 50, seed = 2)
  returns <- rollout(env, search$policy, 50, seed = 2)$episodes$return
  expect_identical(summary$mean, mean(returns))
  expect_equal(summary$se, sd(returns) / sqrt(50))
  expect_identical(summary$reached, mean(returns) >= 12)
  expect_identical(summary$steps, sum(search$episodes$length))
  expect_identical(summary$episodes, nrow(search$episodes))
  expect_output(print(summary), "50 fresh episodes")
  expect_identical(nrow(summary(search)$fresh$episodes), 100L)
  cut <- search_random(env, rounds = 1, max_steps = 2)
  expect_identical(unique(summary(cut)$fresh$episodes$length), 2L)
  expect_error(summary(search, episodes = 0), "`episodes`", class = "gym_error_argument")
})

test_that("CartPole: the mean over fresh episodes comes with its standard error", {
  search <- search_random(seed = 1, client = test_client())
  summary <- summary(search, episodes = 20, seed = 1)
  expect_length(summary$fresh$episodes$return, 20)
  expect_gt(summary$mean, 100)
  expect_identical(summary(search, episodes = 20, seed = 1)$mean, summary$mean)
})
