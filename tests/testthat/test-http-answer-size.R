# The bound is on all that a server may send; what libcurl holds beside it is little.
flooded <- function(how) {
  create_GymClient(local_bad_server("flood", how, frame = parent.frame()), timeout = 30)
}

test_that("an answer without an end is ended", {
  skip_unless_all()
  withr::local_options(gym.max_answer_bytes = 2^24)
  for (how in c("chunks", "length")) {
    client <- flooded(how)
    error <- expect_error(env_list_all(client), "16,777,216 bytes", class = "gym_error_connection")
    expect_match(conditionMessage(error), "gym.max_answer_bytes", fixed = TRUE)
    # It is not taken for an interrupt, and the next call is none the worse.
    expect_error(env_create(client, "CartPole-v1"), "16,777,216", class = "gym_error_connection")
  }
})

test_that("what came packed is not unpacked", {
  skip_unless_all()
  # It would be good JSON.
  client <- create_GymClient(local_bad_server("packed"))
  expect_error(env_list_all(client), "not come from a Gym server", class = "gym_error_connection")
})

test_that("headers without an end are ended", {
  expect_error(env_list_all(flooded("headers")), class = "gym_error_connection")
})

test_that("an answer in JSON may have a sixteenth", {
  server <- local_canned_server(list("/v1/envs/" = list(text = paste0(
    "{\"all_envs\":{}", strrep(" ", 2e5), "}"
  ))))
  expect_identical(env_list_all(server), empty_object)
  withr::local_options(gym.max_answer_bytes = 16e5)
  expect_error(env_list_all(server), "100,000 bytes", class = "gym_error_connection")
})

test_that("the largest answers of our own server fit", {
  env <- local_env("CartPole-v1", num_envs = 10000)
  expect_identical(dim(env$reset(seed = 1)), c(10000L, 4L))
  withr::local_options(gym.max_answer_bytes = 1e5)
  expect_error(env$reset(seed = 1), "100,000 bytes", class = "gym_error_connection")
})

test_that("the option must be a number", {
  withr::local_options(gym.max_answer_bytes = "many")
  env <- local_env("CartPole-v1", num_envs = 10000)
  expect_error(env$reset(), "gym.max_answer_bytes", class = "gym_error_argument")
})
