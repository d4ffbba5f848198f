test_that("the classic calls play an episode", {
  withr::local_options(gym.viewer = FALSE)
  client <- test_client()
  id <- env_create(client, "CartPole-v0")
  expect_match(id, "^[0-9a-f]{8}$")
  expect_identical(env_list_all(client)[[id]], "CartPole-v0")
  observation <- env_reset(client, id)
  expect_type(observation, "double")
  expect_length(observation, 4)
  repeat {
    action <- env_action_space_sample(client, id)
    expect_true(action %in% 0:1)
    results <- env_step(client, id, action, render = TRUE)
    if (results[["done"]]) break
  }
  expect_named(
    results, c("observation", "reward", "done", "info", "terminated", "truncated")
  )
  expect_length(results[[1]], 4)
  expect_identical(results[[2]], 1)
  expect_true(results[[3]])
  expect_identical(results[[4]], structure(list(), names = character()))
  expect_invisible(env_close(client, id))
  expect_null(env_list_all(client)[[id]])
})

test_that("the same seed gives the same episode, seed 0 is a seed", {
  play <- function(...) {
    env <- local_env(...)
    c(list(env$reset()), lapply(c(1, 0, 1, 1), function(action) env$step(action)$observation))
  }
  expect_identical(play(seed = 0), play(seed = 0))
  expect_false(identical(play(seed = 0), play(seed = 1)))
  env <- local_env()
  expect_identical(env$reset(seed = 0), play(seed = 0)[[1]])
})

test_that("Python sees the same numbers", {
  # gymnasium.make("CartPole-v1").reset(seed=42), Gymnasium 1.x
  env <- local_env()
  expect_equal(
    unname(env$reset(seed = 42)), c(0.0273956, -0.00611216, 0.03585979, 0.0197368), tolerance = 1e-6
  )
})

test_that("the seed also fixes the sampling of actions", {
  draw <- function(seed) {
    env <- local_env(seed = seed)
    vapply(1:20, function(i) env_action_space_sample(env$client, env$instance_id), 1L)
  }
  expect_identical(draw(5), draw(5))
  expect_false(identical(draw(5), draw(6)))
})

test_that("a seed that is none is refused before anything is sent", {
  env <- local_env()
  for (bad in list(-1, 1.5, NA, "1", TRUE, c(1, 2), Inf)) {
    expect_error(env$reset(seed = bad), "seed", class = "gym_error_argument")
  }
})

test_that("a reset returns the info, when asked", {
  client <- test_client()
  env <- local_env(seed = 1)
  both <- env$reset(seed = 3, return_info = TRUE)
  expect_named(both, c("observation", "info"))
  expect_identical(both$observation, env$reset(seed = 3))
  expect_identical(both$info, structure(list(), names = character()))
  both$observation <- unname(both$observation)
  expect_identical(env_reset(client, env$instance_id, seed = 3, return_info = TRUE), both)
  taxi <- local_env("Taxi-v4")
  info <- taxi$reset(seed = 1, return_info = TRUE)$info
  expect_length(info$action_mask, 6)
  expect_identical(info$prob, 1)
  expect_error(env$reset(return_info = 1), "return_info", class = "gym_error_argument")
})

test_that("an info may be handed back as options", {
  env <- local_env()
  info <- (function() {
    env$reset()
    env$step(1)$info
  })()
  expect_length(env$reset(options = info), 4)
})

test_that("options reach the environment's reset", {
  env <- local_env()
  expect_true(all(abs(env$reset(options = list(low = 0.2, high = 0.3))) >= 0.2))
  expect_error(env$reset(options = list(1)), "options", class = "gym_error_argument")
})

test_that("an unknown instance is the classic error", {
  client <- test_client()
  calls <- list(
    env_reset = function(id) env_reset(client, id),
    env_step = function(id) env_step(client, id, 1),
    env_action_space_info = function(id) env_action_space_info(client, id),
    env_action_space_sample = function(id) env_action_space_sample(client, id),
    env_observation_space_info = function(id) env_observation_space_info(client, id),
    env_monitor_start = function(id) env_monitor_start(client, id, "tmp", force = TRUE),
    env_monitor_close = function(id) env_monitor_close(client, id),
    env_render = function(id) env_render(client, id),
    env_close = function(id) env_close(client, id)
  )
  for (call in calls) {
    expect_error(call("bad_id"), "Instance_id bad_id unknown", class = "gym_error_http_400")
  }
  expect_error(env_reset(client, NULL), "instance_id", class = "gym_error_argument")
})

test_that("an id that is not known gets a hint", {
  client <- test_client()
  error <- expect_error(env_create(client, "bad string"), class = "gym_error_http_400")
  expect_match(
    conditionMessage(error), "Attempted to look up malformed environment ID 'bad string'",
    fixed = TRUE
  )
  expect_error(env_create(client, "CartPol-v1"), "CartPole-v1", class = "gym_error_http_400")
  error <- expect_error(env_create(client, "FrozenLake-v0"), class = "gym_error_http_400")
  expect_match(error$hint, "FrozenLake-v1")
  expect_error(env_create(client, 5), "env_id", class = "gym_error_argument")
})

test_that("an action outside the space is an error and the environment has not moved", {
  client <- test_client()
  env <- local_env(seed = 1)
  twin <- local_env(seed = 1)
  env$reset()
  twin$reset()
  for (bad in list(2, -1, 0.5, NA, NULL, "1", c(0, 1))) {
    expect_error(
      env$step(bad), if (is.character(bad)) "no action" else "Discrete", class = "gym_error_space"
    )
  }
  expect_identical(env$step(1), twin$step(1))
})

test_that("a number of the wrong length is refused for a Box", {
  env <- local_env("Pendulum-v1")
  env$reset()
  expect_error(env$step(c(0, 0)), "<Box float32 \\[1\\]>", class = "gym_error_space")
  expect_length(env$step(-2)$observation, 3)
})

test_that("a Box action outside of the bounds is the environment's affair", {
  env <- local_env("Pendulum-v1", seed = 1)
  twin <- local_env("Pendulum-v1", seed = 1)
  env$reset()
  twin$reset()
  for (outside in c(2.5, -2.000000238, 1e30)) {
    expect_false(space_contains(env$action_space, outside))
    inside <- max(min(outside, 2), -2)
    expect_identical(env$step(outside)$observation, twin$step(inside)$observation)
  }
  for (bad in c(1e39, Inf, NaN)) expect_error(env$step(bad), class = "gym_error_space")
})

test_that("a step before the first reset is an error", {
  env <- local_env()
  error <- expect_error(env$step(1), class = "gym_error_http_400")
  expect_identical(error$code, "reset_needed")
})

test_that("a step after the end warns once an episode", {
  env <- local_env()
  for (episode in 1:2) {
    env$reset()
    while (!env$step(1)$done) NULL
    expect_warning(env$step(1), "after the end", class = "gym_warning_step_after_done")
    # CartPole says done again at each of these.
    for (step in 1:4) expect_warning(env$step(1), NA)
  }
})

test_that("an exception inside an environment is an error that leaves the others alone", {
  skip_unless_all()
  server <- odd_server()
  env <- make_odd("Failing", server)
  other <- make_odd("Image", server)
  env$reset()
  other$reset()
  error <- expect_error(env$step(1), "the pole caught fire", class = "gym_error_http_500")
  expect_identical(error$code, "environment_error")
  expect_equal(other$step(1)$reward, 1)
  expect_error(env$close(), NA)
  gone <- local_env()
  env_close(gone$client, gone$instance_id)
  expect_error(gone$close(), NA)
})

test_that("the info of an environment arrives", {
  env <- make_odd("Telling", odd_server())
  env$reset()
  out <- env$step(0)
  expect_identical(out$reward, Inf)
  expect_true(out$truncated)
  expect_false(out$terminated)
  expect_identical(out$info$action_mask, c(1L, 0L, 1L))
  expect_identical(out$info$words, c("a", "\u00e9"))
  expect_identical(out$info$nested$x, 0.5)
  expect_identical(out$info$nan, NaN)
  expect_identical(out$info$grid, matrix(0:5, 2, byrow = TRUE))
})

test_that("uploading fails with the reason", {
  client <- test_client()
  expect_error(upload(client, "results", api_key = "k"), "2017", class = "gym_error_http_410")
  withr::local_envvar(OPENAI_GYM_API_KEY = "")
  expect_error(upload(client, "results"), "api_key", class = "gym_error_http_400")
  # The classic order of the arguments.
  expect_error(upload(client, "results", "k"), class = "gym_error_http_410")
})

test_that("an interrupt during a call arrives as an interrupt", {
  skip_unless_all()
  skip_on_os("windows")
  env <- make_odd("Slow", odd_server())
  env$reset()
  killer <- processx::process$new("sh", c("-c", paste("sleep 0.5; kill -INT", Sys.getpid())))
  outcome <- tryCatch(
    {
      env$step(0)
      "finished"
    },
    interrupt = function(cnd) "interrupted",
    error = function(cnd) "error"
  )
  expect_identical(outcome, "interrupted")
  # The step that was interrupted goes on at the server; the next waits for it.
  expect_equal(env$step(0)$reward, 1)
})

test_that("what an environment prints does not hold it up", {
  skip_unless_all()
  env <- make_odd("Chatty", odd_server())
  env$reset()
  for (i in 1:10) expect_equal(env$step(0)$reward, 1)
  expect_match(gym_server_log(env$client), "xxxx", all = FALSE)
})
