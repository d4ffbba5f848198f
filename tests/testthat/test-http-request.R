test_that("an answer that does not come within the timeout is an error", {
  skip_unless_all()
  server <- odd_server()
  patient <- make_odd("Slow", server)
  patient$reset()
  hasty <- create_GymClient(server$remote_base, timeout = 0.3)
  expect_error(env_step(hasty, patient$instance_id, 1), "[Tt]ime", class = "gym_error_connection")
})

# Steps and resets by HTTP.
messages_to <- function(id) paste0("POST /v1/envs/", id, "/stream/")

# An environment after its reset, and a client whose connections break at its messages.
local_cut_env <- function(when, times, frame = parent.frame()) {
  server <- local_server(frame = frame)
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  client <- local_cut_client(server, when, messages_to(id), times, frame)
  steps <- function() get_request(server, paste0("/v1/envs/", id, "/"))$steps
  list(client = client, id = id, steps = steps)
}

test_that("a step whose answer was lost is not taken twice", {
  server <- local_server()
  id <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, id)
  client <- local_cut_client(server, "answered", messages_to(id))
  first <- env_step(client, id, 1)
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)

  twin <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, twin)
  expect_identical(first, env_step(server, twin, 1))
  expect_identical(env_step(client, id, 0), env_step(server, twin, 0))
})

test_that("creating is not done twice, nor is closing", {
  skip_unless_all()
  server <- local_server()
  client <- local_cut_client(server, "answered", "POST /v1/envs/ ")
  id <- env_create(client, "CartPole-v1")
  expect_named(env_list_all(server), id)
  client <- local_cut_client(server, "answered", "/close")
  expect_error(env_close(client, id), NA)
  expect_length(env_list_all(server), 0)
})

test_that("a call that was cut before it was sent is made", {
  skip_unless_all()
  cut <- local_cut_env("unsent", times = 2)
  expect_equal(env_step(cut$client, cut$id, 1)$reward, 1)
  expect_equal(cut$steps(), 1)
})

test_that("a connection that breaks each time is an error in the end", {
  skip_unless_all()
  cut <- local_cut_env("answered", times = 100)
  expect_error(env_step(cut$client, cut$id, 1), class = "gym_error_connection")
  expect_equal(cut$steps(), 1)
})

test_that("a call without a number is not repeated", {
  skip_unless_all()
  server <- local_server()
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  client <- local_cut_client(server, "answered", "/step")
  expect_error(
    post_request(client, paste0("/v1/envs/", id, "/step/"), list(action = 1)),
    class = "gym_error_connection"
  )
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)
})

# A request of which several are under way at once.

describe_body <- function(id) json_body(c(env_id = json_string(id)))

# One of them alone.
description <- function(client, id = "Acrobot-v1") {
  contents <- list(list(body = describe_body(id)))
  answer <- NULL
  perform_several(
    client, rollouts_route, sends = json_type,
    next_content = function() {
      content <- if (length(contents)) contents[[1]]
      contents <<- list()
      content
    },
    received = function(content, response, seconds) {
      answer <<- read_answer(response, "POST")
      TRUE
    }
  )
  answer
}

test_that("answers come to their requests, and no more are under way than allowed", {
  client <- test_client()
  ids <- c("Acrobot-v1", "CartPole-v1", "Pendulum-v1", "MountainCar-v0", "FrozenLake-v1")
  given <- got <- character()
  open <- 0L
  perform_several(
    client, rollouts_route, sends = json_type,
    next_content = function() {
      i <- length(given) + 1L
      if (i > length(ids)) {
        return(NULL)
      }
      given[[i]] <<- ids[[i]]
      open <<- open + 1L
      expect_lte(open, 2L)
      list(id = ids[[i]], body = describe_body(ids[[i]]))
    },
    received = function(content, response, seconds) {
      open <<- open - 1L
      expect_identical(read_answer(response, "POST")$env_id, content$id)
      expect_gte(seconds, 0)
      got <<- c(got, content$id)
      FALSE
    }
  )
  expect_setequal(got, ids)
})

test_that("a server that has too much to do is asked again when it says so", {
  expect_null(pause_before_next(list(status_code = 200L), 1L))
  busy <- function(header) {
    list(status_code = 429L, headers = charToRaw(paste0("HTTP/1.1 429 X\r\n", header, "\r\n\r\n")))
  }
  expect_identical(pause_before_next(busy("Retry-After: 2"), 1L), 2)
  expect_identical(pause_before_next(busy("Retry-After: 4000"), 1L), 60)
  expect_null(pause_before_next(busy("Other: 2"), 1L))
  client <- test_client()
  refused <- 0L
  local_functions(pause_before_next = function(outcome, attempt) {
    refused <<- refused + 1L
    if (refused < 4L) 0.05
  })
  expect_identical(description(client)$env_id, "Acrobot-v1")
  expect_identical(refused, 4L)
})

test_that("a request whose connection broke is sent again, a few times", {
  skip_unless_all()
  server <- local_server()
  for (when in c("answered", "unsent")) {
    cut <- local_cut_client(server, when, "rollouts", times = 3)
    expect_identical(description(cut)$env_id, "Acrobot-v1")
    cut <- local_cut_client(server, when, "rollouts", times = 10)
    expect_error(description(cut), class = "gym_error_connection")
  }
  nobody <- create_GymClient(paste0("http://127.0.0.1:", free_port()))
  expect_error(description(nobody), class = "gym_error_connection")
})

test_that("a server that does not answer anything else either is not waited for", {
  stalled <- create_GymClient(local_stalling("silent"), timeout = 0.5)
  expect_error(description(stalled), class = "gym_error_connection")
})

test_that("an answer that is too large ends the call, and errors are those of the server", {
  client <- test_client()
  withr::local_options(gym.max_answer_bytes = 10)
  local_binding("small_answer", 5)
  expect_error(description(client), "larger than 10 bytes", class = "gym_error_connection")
  withr::local_options(gym.max_answer_bytes = NULL)
  expect_error(description(client, "CarPole-v1"), class = "gym_error_http")
  expect_identical(description(client)$env_id, "Acrobot-v1")
})
