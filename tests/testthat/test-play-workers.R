# Rollouts whose sub-environments are run by worker processes: those that are played from R, as a
# function is the policy.

still <- function(observation) rep(0L, length(observation))

wandering <- function(observation) sample.int(4L, length(observation), replace = TRUE) - 1L

test_that("a rollout is the same for any number of workers, also where the policy draws", {
  skip_unless_all()
  client <- test_client()
  networks <- policy_candidates(policy_network(c(16, 4)), rbind(sin(1:64), cos(1:64)))
  for (policy in list(wandering, still, list(wandering, networks$policy))) {
    play <- function(num_workers, ...) {
      rollout("FrozenLake-v1", policy, 20, seed = 1, num_envs = 7, num_workers = num_workers,
              steps = TRUE, next_observation = TRUE, client = client, ...)
    }
    none <- play(0)
    for (num_workers in list(1, 2, 3, NULL)) {
      expect_identical(play(num_workers), none)
    }
    expect_identical(play(2, max_steps = 3), play(0, max_steps = 3))
  }
})

test_that("episodes begun by the environment itself are those of explicit resets", {
  env <- local_env("FrozenLake-v1", num_envs = 7, autoreset_mode = "Disabled",
                   vectorization_mode = "sync")
  play <- function(env, ...) rollout(env, policy_random(), 40, seed = 1, steps = TRUE, ...)
  parts <- c("episodes", "steps")
  by_itself <- local_env("FrozenLake-v1", num_envs = 7, autoreset_mode = "SameStep",
                         num_workers = 2)
  expect_identical(by_itself$num_workers, 2L)
  expect_true(as_vector_env(by_itself)$begins_next)
  expect_identical(play(by_itself)[parts], play(env)[parts])
})

test_that("an environment says how many workers it has", {
  env <- local_env("FrozenLake-v1", num_envs = 4, num_workers = 2)
  expect_output(print(env), "4 sub-environments (async, 2 workers, NextStep)", fixed = TRUE)
  none <- local_env("FrozenLake-v1", num_envs = 4, num_workers = 0)
  expect_identical(none$num_workers, 0L)
  expect_output(print(none), "4 sub-environments (sync, NextStep)", fixed = TRUE)
  expect_null(local_env("CartPole-v1", num_envs = 2)$num_workers)
  expect_null(local_env("CartPole-v1")$num_workers)
})

test_that("what is no number of workers, or for no sub-environments, is refused", {
  for (bad in list(-1, 0.5, NA, "2", c(1, 2))) {
    expect_error(rollout("FrozenLake-v1", policy_random(), num_workers = bad, client = no_client()),
                 "`num_workers` must be a whole number", class = "gym_error_argument")
  }
  client <- test_client()
  expect_error(gym_make("FrozenLake-v1", num_workers = 2, client = client),
               "`num_workers` is for an environment with sub-environments",
               class = "gym_error_argument")
  cnd <- expect_error(
    rollout("CartPole-v1", policy_random(), num_workers = 2, client = client),
    "own vector implementation", class = "gym_error_argument"
  )
  expect_identical(cnd$argument, "num_workers")
  expect_error(gym_make("CartPole-v1", num_envs = 2, vectorization_mode = "vector_entry_point",
                        num_workers = 2, client = client), class = "gym_error_http_400")
  expect_error(rollout(fake_environment(), policy_random(), num_workers = 2), "was made before",
               class = "gym_error_argument")
})

test_that("more workers than the server allows are the server's error", {
  skip_unless_all()
  few <- local_server(max_processes = 1)
  cnd <- expect_error(
    rollout("FrozenLake-v1", still, 40, num_workers = 2, client = few),
    class = "gym_error_http_429"
  )
  expect_identical(cnd$code, "too_many_processes")
  expect_length(env_list_all(few), 0)
})

# How many instances are made until the test ends: a function that returns their number.
count_instances <- function(frame = parent.frame()) {
  made <- 0L
  create <- gym:::create_instance
  local_functions(create_instance = function(...) {
    made <<- made + 1L
    create(...)
  }, frame = frame)
  function() made
}

test_that("a server that describes environments makes no instance to look at", {
  skip_unless_all()
  client <- local_server()
  made <- count_instances()
  for (id in c("FrozenLake-v1", "FrozenLake-v1", "FrozenLake8x8-v1")) {
    rollout(id, still, 2, client = client)
  }
  expect_identical(made(), 3L)
})

test_that("nor does one that plays no whole episodes: sub-environments have their own seeds", {
  local_functions(known_description = function(...) NULL)
  client <- local_server()
  made <- count_instances()
  for (id in c("FrozenLake-v1", "CartPole-v1")) {
    played <- rollout(id, policy_random(), 2, seed = 1, client = client)
    expect_identical(anyDuplicated(played$episodes$seed), 0L)
  }
  expect_identical(made(), 2L)
})

test_that("there are as many sub-environments as fit a mebibyte of observations, 16 to 256", {
  expect_identical(count_sub_envs(32), 256L)
  expect_identical(count_sub_envs(84 * 84 * 4), 32L)
  expect_identical(count_sub_envs(210 * 160 * 3), 16L)
  picture <- box_space(0, 255, c(84L, 84L, 4L), "uint8")
  expect_identical(observation_bytes(picture), 84 * 84 * 4)
  expect_identical(observation_bytes(box_space(rep(0, 8), rep(1, 8))), 32)
  expect_identical(observation_bytes(box_space(0, 1, 3L, "bool")), 3)
  expect_identical(observation_bytes(space_tuple(picture, picture)), 2 * 84 * 84 * 4)
  expect_identical(counts_to_try(256L), c(256, 64, 16))
  expect_identical(counts_to_try(16L), c(16, 4))
  expect_identical(counts_to_try(3L), 3)
})

test_that("a worker killed in the middle ends a rollout with the batches before it", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_server()
  server_pid <- the_session$servers[[server$remote_base]]$process$get_pid()
  calls <- 0L
  policy <- function(observation) {
    calls <<- calls + 1L
    # Enough for the first batch of eight episodes, which take some steps each.
    if (calls == 400L) {
      workers <- as.integer(system2("pgrep", c("-P", server_pid), stdout = TRUE))
      tools::pskill(workers, tools::SIGKILL)
    }
    sample(0:3, length(observation), replace = TRUE)
  }
  cnd <- expect_error(
    rollout("FrozenLake-v1", policy, 2000, seed = 1, num_envs = 2, num_workers = 2,
            client = server),
    class = "gym_error_rollout"
  )
  expect_s3_class(cnd, "gym_error_http")
  expect_identical(cnd$code, "environment_died")
  expect_gt(nrow(cnd$result$episodes), 0L)
  expect_identical(nrow(cnd$result$episodes) %% 8L, 0L)
  expect_identical(nrow(rollout("FrozenLake-v1", policy_random(), 3, client = server)$episodes), 3L)
})

test_that("no more workers are asked for than there are sub-environments", {
  client <- test_client()
  play <- function(...) rollout("FrozenLake-v1", wandering, seed = 1, client = client, ...)
  expect_identical(play(1, num_workers = 2)$episodes, play(1)$episodes)
  expect_identical(play(3, num_workers = 5)$episodes, play(3)$episodes)
})

test_that("more workers than the sub-environments asked for are the server's error", {
  cnd <- expect_error(
    rollout("FrozenLake-v1", still, 40, num_envs = 2, num_workers = 3,
            client = test_client()),
    class = "gym_error_http_400"
  )
  expect_match(conditionMessage(cnd), "num_workers")
})
