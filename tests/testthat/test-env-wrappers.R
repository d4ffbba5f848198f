test_that("wrappers are written with a pipe and print in one line", {
  wrapped <- "CartPole-v1" |>
    gym_wrap("TimeLimit", max_episode_steps = 50) |>
    gym_wrap("NormalizeReward")
  expect_output(
    print(wrapped), "<CartPole-v1 |> TimeLimit(max_episode_steps = 50) |> NormalizeReward()>",
    fixed = TRUE
  )
  expect_identical(
    wrappers_json(wrapped$wrappers),
    paste0("[{\"name\":\"TimeLimit\",\"kwargs\":{\"max_episode_steps\":50}},",
           "{\"name\":\"NormalizeReward\"}]")
  )
})

test_that("what is no wrapper is refused before anything is sent", {
  for (bad in list(1, "TimeLimit", list("TimeLimit"), list(list(1)), list(list("a", 2)))) {
    expect_error(
      env_create(create_GymClient("http://127.0.0.1:1"), "CartPole-v1", wrappers = bad),
      "wrappers", class = "gym_error_argument"
    )
  }
  expect_error(gym_wrap("CartPole-v1", 3), class = "gym_error_argument")
  expect_error(gym_wrap("CartPole-v1", "TimeLimit", 3), class = "gym_error_argument")
})

length_of_episode <- function(env) {
  env$reset(seed = 1)
  for (step in 1:100) if (env$step(step %% 2)$done) break
  step
}

test_that("a wrapper is applied at creation, in each way to make an environment", {
  client <- test_client()
  limit <- list(list("TimeLimit", max_episode_steps = 7))
  expect_identical(length_of_episode(local_env("CartPole-v1", wrappers = limit)), 7L)
  wrapped <- gym_wrap("CartPole-v1", "TimeLimit", max_episode_steps = 7)
  expect_identical(length_of_episode(local_env(wrapped)), 7L)
  id <- env_create(client, "CartPole-v1", wrappers = limit)
  env_reset(client, id, seed = 1)
  done <- vapply(1:7, function(i) env_step(client, id, i %% 2)$truncated, NA)
  expect_identical(done, rep(c(FALSE, TRUE), c(6, 1)))
  env_close(client, id)
  balance <- function(observation) as.integer(observation[, 3] + observation[, 4] > 0)
  expect_identical(rollout(wrapped, balance, seed = 1, client = client)$episodes$length, 7L)
})

test_that("the spaces are those of the wrapped environment, in the order of the pipe", {
  env <- local_env(
    "CartPole-v1" |> gym_wrap("FrameStackObservation", stack_size = 3) |>
      gym_wrap("FlattenObservation")
  )
  expect_identical(env$observation_space$shape, 12L)
  expect_length(env$reset(), 12)
  pendulum <- local_env(gym_wrap("Pendulum-v1", "RescaleAction", min_action = -1, max_action = 1))
  expect_identical(pendulum$action_space$high, 1)
})

test_that("a wrapper that is not allowed, or has no such argument, is the server's error", {
  error <- expect_error(local_env(gym_wrap("CartPole-v1", "RecordVideo")),
                        class = "gym_error_http_400")
  expect_identical(error$code, "wrapper_not_allowed")
  expect_match(conditionMessage(error), "TimeLimit")
  error <- expect_error(local_env(gym_wrap("CartPole-v1", "TimeLimit", steps = 1)),
                        class = "gym_error_http_400")
  expect_identical(error$code, "invalid_kwargs")
})
