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
      expect_identical(response$answer$env_id, content$id)
      expect_gte(seconds, 0)
      got <<- c(got, content$id)
      FALSE
    }
  )
  expect_setequal(got, ids)
})

test_that("a server that has too much to do is asked again when it says so", {
  expect_null(seconds_to_wait(list(status_code = 200L)))
  busy <- function(header) {
    list(status_code = 429L, headers = charToRaw(paste0("HTTP/1.1 429 X\r\n", header, "\r\n\r\n")))
  }
  expect_identical(seconds_to_wait(busy("Retry-After: 2")), 2)
  expect_identical(seconds_to_wait(busy("Retry-After: 4000")), 60)
  expect_null(seconds_to_wait(busy("Other: 2")))
  client <- test_client()
  refused <- 0L
  local_functions(seconds_to_wait = function(response) {
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
