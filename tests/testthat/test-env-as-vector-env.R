test_that("an id is made as a vector environment, and closed by it", {
  client <- local_server()
  poles <- as_vector_env("CartPole-v1", client = client)
  expect_s3_class(poles, "gym_vector_env")
  expect_identical(poles$num_envs, 256L)
  expect_identical(poles$batch_size, 256L)
  expect_true(poles$one_seed)
  expect_identical(dim(poles$reset(1)), c(256L, 4L))
  out <- poles$step(c(1L, 0L), c(2L, 5L))
  expect_identical(dim(out$observation), c(2L, 4L))
  expect_identical(dim(out$next_observation), c(2L, 4L))
  poles$close()
  expect_length(env_list_all(client), 0)
  lakes <- as_vector_env("FrozenLake-v1", max_envs = 3, is_slippery = FALSE, client = client)
  expect_identical(lakes$num_envs, 3L)
  expect_identical(lakes$batch_size, 1024L)
  expect_false(lakes$one_seed)
  expect_identical(lakes$reset(1:3, 1:3), c(0L, 0L, 0L))
  # 2 is to the right, 1 is down; the ice is not slippery.
  expect_identical(lakes$step(c(2L, 1L), c(1L, 3L))$observation, c(1L, 4L))
  lakes$close()
  expect_length(env_list_all(client), 0)
})

test_that("a sub-environment may be reset alone, and the others take no step", {
  lakes <- as_vector_env("FrozenLake-v1", num_envs = 3, is_slippery = FALSE, client = test_client())
  withr::defer(lakes$close())
  lakes$reset(1:3, 1:3)
  lakes$step(c(2L, 2L, 2L), 1:3)
  expect_identical(lakes$reset(7L, 2L), 0L)
  expect_identical(lakes$step(c(2L, 2L, 2L), 1:3)$observation, c(2L, 1L, 2L))
})

test_that("one sub-environment is an environment without any, with the same results", {
  alone <- as_vector_env("Acrobot-v1", num_envs = 1, client = test_client())
  withr::defer(alone$close())
  expect_null(alone$env$num_envs)
  policy <- function(observation) as.integer(observation[, 1] > 0)
  played <- lapply(list(NULL, 0), function(num_workers) {
    rollout("Acrobot-v1", policy, 2, max_steps = 5, num_envs = 1, num_workers = num_workers,
            seed = 1, client = test_client())
  })
  expect_equal(as.data.frame(played[[1L]]), as.data.frame(played[[2L]]))
})

test_that("what was made before is played as it is, and stays open", {
  env <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync")
  seen <- as_vector_env(env)
  expect_identical(seen$num_envs, 3L)
  seen$close()
  expect_true(env$is_open)
  expect_error(as_vector_env(env, num_envs = 4), "`num_envs` is for an environment given by its id",
               class = "gym_error_argument")
  expect_error(as_vector_env(1), class = "gym_error_argument")
})

test_that("what remembers earlier episodes has one sub-environment, and says what remembers", {
  client <- test_client()
  wrapped <- "CartPole-v1" |>
    gym_wrap("NormalizeObservation") |>
    gym_wrap("TimeLimit", max_episode_steps = 9)
  seen <- as_vector_env(wrapped, client = client)
  withr::defer(seen$close())
  expect_identical(seen$remembers, "NormalizeObservation")
  expect_identical(seen$num_envs, 1L)
  made <- local_env(wrapped)
  expect_identical(made$spec$wrappers, c("NormalizeObservation", "TimeLimit"))
  expect_identical(as_vector_env(made)$remembers, "NormalizeObservation")
})

test_that("another class of environments is played by its own method", {
  counter <- structure(list(), class = "a_counter")
  as_counters <- function(x, num_envs = NULL, ...) {
    at <- integer(2)
    structure(
      list(
        observation_space = discrete_space(9L), action_space = discrete_space(2L),
        spec = list(id = "Counter"), num_envs = 2L, batch_size = 2L, one_seed = FALSE,
        remembers = character(), close = function(wait = TRUE) NULL,
        reset = function(seeds, which) {
          at[which] <<- 0L
          at[which]
        },
        step = function(action, which) {
          at[which] <<- at[which] + action
          list(observation = at[which], reward = action, terminated = at[which] >= 3L,
               truncated = logical(length(which)), next_observation = at[which])
        }
      ),
      class = "gym_vector_env"
    )
  }
  registerS3method("as_vector_env", "a_counter", as_counters, asNamespace("gym"))
  played <- rollout(counter, function(observation) rep(1L, length(observation)), 5)
  expect_identical(played$episodes$length, rep(3L, 5))
  expect_identical(played$episodes$sub_env, c(1:2, 1:2, 1L))
  expect_identical(played$env_id, "Counter")
})

test_that("those that play are stepped with those before, until fewer than half of these play", {
  asked <- NULL
  # The observation of each is its action.
  take <- function(action, which, infos, finals) {
    asked <<- list(action = action, which = which)
    n <- length(action)
    list(observation = action, reward = numeric(n), terminated = logical(n),
         truncated = logical(n), next_observation = action)
  }
  env <- structure(
    list(num_envs = 8L, single_action_space = space_discrete(100),
         single_observation_space = space_discrete(100), step = take),
    class = "gym_server_env"
  )
  step <- bare_stepper(env)
  step(11:18, 1:8)
  expect_identical(asked, list(action = 11:18, which = NULL))
  playing <- c(1L, 2L, 4L, 6L, 8L)
  expect_identical(step(playing, playing)$observation, playing)
  expect_null(asked$which)
  expect_identical(asked$action[playing], playing)
  expect_length(asked$action, 8L)
  step(31:34, c(1L, 2L, 6L, 8L))
  expect_identical(asked, list(action = 31:34, which = c(1L, 2L, 6L, 8L)))
  expect_identical(step(41:43, c(2L, 6L, 8L))$observation, 41:43)
  expect_identical(asked$which, c(1L, 2L, 6L, 8L))
  expect_identical(asked$action[2:4], 41:43)
  step(5L, 8L)
  expect_identical(asked, list(action = 5L, which = 8L))
  # One that was left out is back.
  step(6:7, c(3L, 8L))
  expect_identical(asked$which, c(3L, 8L))
})

test_that("rows of a step are taken of all that it returned", {
  env <- list(single_observation_space = box_space(rep(0, 2), rep(9, 2)))
  observation <- matrix(1:6 + 0, 3)
  out <- list(observation = observation, reward = c(0.1, 0.2, 0.3),
              terminated = c(FALSE, TRUE, FALSE), truncated = c(TRUE, FALSE, FALSE),
              next_observation = observation + 10)
  expect_identical(
    rows_of_step(env, out, 2:3),
    list(observation = observation[2:3, ], reward = c(0.2, 0.3), terminated = c(TRUE, FALSE),
         truncated = c(FALSE, FALSE), next_observation = observation[2:3, ] + 10)
  )
  out$next_observation <- observation
  expect_identical(rows_of_step(env, out, 1)$next_observation, observation[1, , drop = FALSE])
})
