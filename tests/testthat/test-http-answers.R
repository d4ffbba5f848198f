test_that("a JSON answer has no tensors, whatever the server calls a field", {
  content <- charToRaw('{"reward":1,"tensors":{"observation":["text"]}}')
  response <- list(status_code = 200L, type = json_type, content = content)
  expect_identical(parsed_body(response), list(reward = 1L))
})

test_that("what is no answer of a Gym server is an error with a class", {
  read <- function(status, body) {
    parse_server_error_or_raise_for_status(structure(
      list(status_code = status, content = charToRaw(body), url = "http://127.0.0.1:1/",
           type = "text/html", request = list(method = "GET")),
      class = "response"
    ))
  }
  expect_error(read(200, "<html>"), class = "gym_error_connection")
  expect_error(read(200, "\"oops\""), class = "gym_error_connection")
  expect_error(read(302, ""), class = "gym_error_connection")
  expect_error(read(520, "\"oops\""), class = "gym_error_http_520")
})

test_that("another kind of server is distinguished from a Gym server", {
  python <- working_python()
  folder <- withr::local_tempdir()
  dir.create(file.path(folder, "v1", "envs"), recursive = TRUE)
  writeLines("<html>", file.path(folder, "v1", "envs", "index.html"))
  log <- file.path(folder, "log")
  process <- processx::process$new(
    python, c("-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", folder),
    stdout = log, stderr = NULL
  )
  withr::defer(process$kill())
  while (process$is_alive() && !length(readLines(log))) Sys.sleep(0.05)
  client <- create_GymClient(sub(".*(http://[0-9.:]+).*", "\\1", readLines(log)[[1]]))
  expect_error(env_list_all(client), "not come from a Gym server", class = "gym_error_connection")
  expect_error(env_create(client, "CartPole-v1"), class = "gym_error_http_501")
})

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
