# A client of a server that has the protocol of gym-http-api and nothing more, see
# classic_server.py.
local_classic_client <- function(frame = parent.frame()) {
  create_GymClient(local_python_server("classic_server.py", frame = frame), timeout = 20)
}

test_that("the classic calls work with a server that has no others", {
  client <- local_classic_client()
  id <- env_create(client, "CartPole-v0")
  expect_identical(env_list_all(client)[[id]], "CartPole-v0")
  expect_length(env_reset(client, id), 4)
  expect_identical(env_action_space_info(client, id)$n, 2L)
  observed <- env_observation_space_info(client, id)
  expect_identical(observed$shape, 4L)
  expect_identical(is.finite(observed$high), c(TRUE, FALSE, TRUE, FALSE))
  expect_true(env_action_space_sample(client, id) %in% 0:1)
  expect_true(env_action_space_contains(client, id, 1))
  expect_false(env_action_space_contains(client, id, 2))
  expect_true(env_observation_space_contains(client, id, c(0, 100, 0, 0)))
  expect_false(env_observation_space_contains(client, id, c(9, 0, 0, 0)))
  env_monitor_start(client, id, "results", force = TRUE)
  env_monitor_close(client, id)
  expect_invisible(env_close(client, id))
  expect_length(env_list_all(client), 0)
  expect_error(env_reset(client, id), "unknown", class = "gym_error_http_400")
  expect_error(env_reset(client, "0123abcd"), "0123abcd unknown", class = "gym_error_http_400")
  expect_error(env_create(client, "Nothing-v0"), "malformed", class = "gym_error_http_400")
  expect_invisible(shutdown_server(client))
})

test_that("an episode there ends as Gym reports it", {
  client <- local_classic_client()
  id <- env_create(client, "CartPole-v1")
  env_reset(client, id)
  steps <- 0
  repeat {
    out <- env_step(client, id, 1)
    steps <- steps + 1
    if (out$done) break
    expect_false(out$terminated || out$truncated)
  }
  expect_named(out, c("observation", "reward", "done", "info", "terminated", "truncated"))
  expect_lt(steps, 20)
  expect_true(out$terminated)
  expect_false(out$truncated)
  id <- env_create(client, "Pendulum-v1")
  expect_identical(env_reset(client, id, return_info = TRUE)$info, empty_object)
  for (step in 1:200) out <- env_step(client, id, 0.5)
  expect_identical(out[c("done", "terminated", "truncated")],
                   list(done = TRUE, terminated = FALSE, truncated = TRUE))
})

test_that("a space of which that server sends only the name passes values as they are", {
  client <- local_classic_client()
  id <- env_create(client, "Blackjack-v1")
  expect_length(env_reset(client, id), 3)
  observed <- env_observation_space_info(client, id)
  expect_output(print(observed), "Tuple (not described)", fixed = TRUE)
  expect_error(space_sample(observed), "only the name", class = "gym_error_argument")
  expect_type(env_step(client, id, 0)$reward, "double")
})

test_that("what that server would ignore is refused", {
  client <- local_classic_client()
  cnd <- expect_error(env_create(client, "CartPole-v1", num_envs = 2),
                      "which has no `num_envs`", class = "gym_error_http")
  expect_identical(cnd$code, "not_supported")
  expect_length(env_list_all(client), 0)
  id <- env_create(client, "CartPole-v1", seed = 1)
  expect_error(env_reset(client, id, seed = 1), "which has no `seed` here",
               class = "gym_error_http")
})

test_that("environment objects are refused there, and nothing is left", {
  client <- local_classic_client()
  cnd <- expect_error(gym_make("CartPole-v1", client = client), "classic calls",
                      class = "gym_error_http")
  expect_identical(cnd$code, "not_supported")
  expect_error(rollout("CartPole-v1", policy_random(), client = client), "classic calls",
               class = "gym_error_http")
  expect_length(env_list_all(client), 0)
})

test_that("the post's script plays on that server", {
  skip_unless_all()
  client <- local_classic_client()
  id <- env_create(client, "CartPole-v0")
  for (episode in 1:2) {
    observation <- env_reset(client, id)
    repeat {
      results <- env_step(client, id, env_action_space_sample(client, id), render = TRUE)
      expect_length(results[[1]], 4)
      expect_identical(results[[2]], 1)
      if (results[["done"]]) break
    }
  }
  env_close(client, id)
})

test_that("a step that was cut is not repeated there, where it would be done twice", {
  client <- local_cut_client(local_classic_client(), "answered", "/step")
  id <- env_create(client, "CartPole-v1")
  env_reset(client, id)
  expect_error(env_step(client, id, 1), class = "gym_error_connection")
  expect_equal(env_step(client, id, 1)$reward, 1)
})
