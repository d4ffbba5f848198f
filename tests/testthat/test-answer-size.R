# The bound is on all that a server may send; what libcurl holds beside it is little.
flooded <- function(how, timeout = 30) {
  create_GymClient(local_bad_server("flood", how, frame = parent.frame()), timeout = timeout)
}

# In megabytes, by the system.
peak_memory <- function() {
  skip_if_not(file.exists("/proc/self/status"))
  line <- grep("^VmHWM", readLines("/proc/self/status"), value = TRUE)
  as.numeric(gsub("[^0-9]", "", line)) / 1024
}

test_that("an answer without an end is ended", {
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
  # Each megabyte of its zeros is a kilobyte: more than the timeout allows.
  client <- flooded("gzip", timeout = 2)
  before <- peak_memory()
  expect_error(env_list_all(client), class = "gym_error_connection")
  expect_lt(peak_memory() - before, 50)
})

test_that("headers without an end are ended", {
  expect_error(env_list_all(flooded("headers")), class = "gym_error_connection")
})

test_that("an answer in JSON may have a sixteenth", {
  server <- local_canned_server(list("/v1/envs/" = list(text = paste0(
    "{\"all_envs\":{}", strrep(" ", 2000), "}"
  ))))
  expect_identical(env_list_all(server), empty_object)
  withr::local_options(gym.max_answer_bytes = 16000)
  expect_error(env_list_all(server), "1,000 bytes", class = "gym_error_connection")
})

test_that("the largest answers of our own server fit", {
  # Numbers of a thousand sub-environments, and a picture.
  env <- local_env("CartPole-v1", num_envs = 1000)
  expect_identical(dim(env$reset(seed = 1)), c(1000L, 4L))
  withr::local_options(gym.max_answer_bytes = 1000)
  expect_error(env$reset(seed = 1), "1,000 bytes", class = "gym_error_connection")
})

test_that("the option must be a number", {
  withr::local_options(gym.max_answer_bytes = "many")
  expect_error(env_list_all(test_client()), "gym.max_answer_bytes", class = "gym_error_argument")
})
