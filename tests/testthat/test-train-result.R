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
