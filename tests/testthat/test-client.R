test_that("a client prints its address", {
  expect_output(
    print(create_GymClient("http://127.0.0.1:5000")), "<GymClient: http://127.0.0.1:5000>",
    fixed = TRUE
  )
})

test_that("a slash at the end of the address changes nothing", {
  expect_identical(create_GymClient("http://127.0.0.1:5000/")$remote_base, "http://127.0.0.1:5000")
})

test_that("what is no address is refused and named", {
  expect_error(create_GymClient("127.0.0.1:5000"), "127.0.0.1:5000", class = "gym_error_argument")
  expect_error(create_GymClient(5000), "5000", class = "gym_error_argument")
  expect_error(create_GymClient("http://a", timeout = 0), "timeout", class = "gym_error_argument")
  expect_error(create_GymClient("http://a", config = list()), "config",
               class = "gym_error_argument")
})

test_that("what is no client is refused", {
  expect_error(env_list_all("http://127.0.0.1:5000"), "client", class = "gym_error_argument")
})

test_that("what cannot be a query or a body is refused by name before it is sent", {
  client <- create_GymClient("http://127.0.0.1:1")
  refused <- function(data, text, request = get_request) {
    cnd <- expect_error(request(client, "/v1/registry/", data), class = "gym_error_argument")
    expect_match(conditionMessage(cnd), text, fixed = TRUE)
  }
  refused(list(search = c("a", "b")), "`data$search` must be one value, not c(\"a\", \"b\")")
  refused(list(search = NULL), "`data$search` must be one value, not NULL")
  refused(list(search = NA), "`data$search` must be one value, not NA")
  refused(list(search = list(1)), "`data$search` must be one value, not a list of length 1")
  for (request in list(get_request, post_request)) {
    refused(list("a"), "`data` must be a list with names", request)
    refused(3, "`data` must be a list with names", request)
    refused(list(a = 1, a = 2), "`data` has `a` more than once", request)
  }
})

test_that("classic requests go to any route", {
  client <- test_client()
  expect_equal(get_request(client, "/v1/health/")$status, "ok")
  id <- post_request(client, "/v1/envs/", list(env_id = "CartPole-v1"))$instance_id
  expect_match(id, "^[0-9a-f]{8}$")
  expect_null(post_request(client, paste0("/v1/envs/", id, "/close/")))
})

test_that("an answer of httr's is read or raised", {
  skip_unless_all()
  base <- local_server(token = FALSE)$remote_base
  answer <- parse_server_error_or_raise_for_status(httr::GET(paste0(base, "/v1/health/")))
  expect_equal(answer$status, "ok")
  expect_error(
    parse_server_error_or_raise_for_status(httr::GET(paste0(base, "/v1/envs/nobody/"))),
    "Instance_id nobody unknown",
    class = "gym_error_http_400"
  )
})

test_that("environments in R, models and bandits are played where there is no Python", {
  skip_unless_all()
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"), readLines(test_path("play_without_python.R"))
  ))
  run <- processx::run(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", script), timeout = 120,
    wd = withr::local_tempdir(), error_on_status = FALSE
  )
  expect_identical(run$stdout, "")
  expect_identical(run$status, 0L)
})

# A session that has no Python, where the answers to gym_server_install()'s question are known.
# Returns what gym_server_install() was called with.
local_bare_session <- function(answers, interactive = TRUE, frame = parent.frame()) {
  withr::local_envvar(
    GYM_PYTHON = NA, GYM_SERVER_URL = NA, GYM_INSTALL = NA, .local_envir = frame
  )
  withr::local_options(rlang_interactive = interactive, .local_envir = frame)
  local_session(client = NULL, install_declined = NULL, frame = frame)
  calls <- new.env()
  calls$ask <- logical()
  local_functions(
    python_candidates = function(python = NULL) python %||% character(),
    gym_server_install = function(..., ask = NA) {
      calls$ask <- c(calls$ask, ask)
      stats::runif(1)
      answer <- answers[[1L]]
      answers <<- answers[-1L]
      invisible(answer)
    },
    frame = frame
  )
  calls
}

test_that("an interactive session without a Python installs when asked, and goes on", {
  skip_unless_all()
  python <- working_python()
  calls <- local_bare_session(list(python))
  set.seed(1)
  before <- .Random.seed
  env <- gym_make("CartPole-v1", seed = 1)
  expect_identical(.Random.seed, before)
  withr::defer(gym_server_stop(env$client))
  expect_length(env$reset(), 4)
  expect_identical(calls$ask, TRUE)
})

test_that("after a no comes the error, and no further question", {
  calls <- local_bare_session(list(NULL))
  for (call in list(gym_client, function() gym_make("CartPole-v1"), search_random,
                    gym_server_start)) {
    error <- expect_error(call(), class = "gym_error_server_start")
    expect_match(conditionMessage(error), "gym::gym_server_install()", fixed = TRUE)
    expect_lt(length(strsplit(conditionMessage(error), "\n")[[1]]), 4)
  }
  expect_identical(calls$ask, TRUE)
})

test_that("a script is not asked, and the error names the call that helps", {
  calls <- local_bare_session(list(), interactive = FALSE)
  error <- expect_error(gym_client(), class = "gym_error_server_start")
  expect_match(conditionMessage(error), "gym::gym_server_install()", fixed = TRUE)
  expect_match(conditionMessage(error), "GYM_INSTALL=1", fixed = TRUE)
  expect_length(calls$ask, 0)
})

test_that("with GYM_INSTALL a script installs without a question", {
  skip_unless_all()
  python <- working_python()
  for (allowed in c("1", "true", "TRUE")) {
    calls <- local_bare_session(list(python), interactive = FALSE)
    withr::local_envvar(GYM_INSTALL = allowed)
    server <- gym_server_start()
    expect_type(env_list_all(server), "list")
    gym_server_stop(server)
    expect_identical(calls$ask, FALSE)
  }
  calls <- local_bare_session(list(), interactive = FALSE)
  withr::local_envvar(GYM_INSTALL = "0")
  expect_error(gym_server_start(), class = "gym_error_server_start")
  expect_length(calls$ask, 0)
})

test_that("where a Python is named nothing is installed", {
  calls <- local_bare_session(list())
  withr::local_envvar(GYM_INSTALL = "1")
  expect_error(gym_server_start(python = "/no/such/python"), "/no/such/python",
               class = "gym_error_server_start")
  withr::local_envvar(GYM_PYTHON = "/no/other/python")
  local_functions(python_candidates = function(python = NULL) "/no/other/python")
  error <- expect_error(gym_client(), "/no/other/python", class = "gym_error_server_start")
  expect_match(conditionMessage(error), "Sys.unsetenv(\"GYM_PYTHON\")", fixed = TRUE)
  expect_length(calls$ask, 0)
})

test_that("looking whether examples can run asks nothing and installs nothing", {
  calls <- local_bare_session(list())
  expect_false(can_start_server())
  withr::local_envvar(GYM_INSTALL = "1")
  expect_false(can_start_server())
  expect_length(calls$ask, 0)
})

test_that("an installed Python that cannot run the server is named", {
  local_bare_session(list("/no/such/python"))
  local_functions(installed_server = function() list(python = "/no/such/python"))
  error <- expect_error(gym_client(), class = "gym_error_server_start")
  expect_match(conditionMessage(error), "/no/such/python", fixed = TRUE)
})

# An interactive session whose answers to create_GymClient()'s question are known. Returns
# the questions.
local_answers <- function(answers, frame = parent.frame()) {
  withr::local_options(rlang_interactive = TRUE, .local_envir = frame)
  local_session(start_declined = NULL, frame = frame)
  asked <- new.env()
  asked$questions <- character()
  local_functions(
    ask_yes_no = function(question, ...) {
      asked$questions <- c(asked$questions, question)
      answer <- answers[[1L]]
      answers <<- answers[-1L]
      answer
    },
    frame = frame
  )
  asked
}

test_that("where nothing listens the first call asks for a server, and the script goes on", {
  skip_unless_all()
  skip_if_no_server()
  for (host in c("127.0.0.1", "localhost")) {
    base <- paste0("http://", host, ":", free_port())
    asked <- local_answers(list(TRUE))
    server <- create_GymClient(paste0(base, "/"))
    expect_length(asked$questions, 0)
    expect_message(id <- env_create(server, "CartPole-v0"), "stops with this R session")
    expect_match(asked$questions, base, fixed = TRUE)
    expect_length(env_reset(server, id), 4)
    expect_type(gym_server_log(server), "character")
    # Now somebody listens.
    env_list_all(create_GymClient(base))
    expect_length(asked$questions, 1)
    gym_server_stop(server)
    expect_error(env_list_all(server), class = "gym_error_connection")
  }
})

test_that("after a no there is no further question for that address", {
  base <- paste0("http://127.0.0.1:", free_port())
  asked <- local_answers(list(FALSE, FALSE))
  first_call <- function(base) {
    expect_error(env_list_all(create_GymClient(base)), class = "gym_error_connection")
  }
  error <- first_call(base)
  expect_match(conditionMessage(error), "gym_server_start(port = ", fixed = TRUE)
  first_call(base)
  expect_length(asked$questions, 1)
  first_call(paste0("http://127.0.0.1:", free_port()))
  expect_length(asked$questions, 2)
})

test_that("there is no question in a script, elsewhere, or where something listens", {
  asked <- local_answers(list())
  expect_unasked <- function(base, ...) {
    client <- create_GymClient(base, timeout = 1, ...)
    expect_error(env_list_all(client), class = "gym_error_connection")
  }
  for (elsewhere in c("http://lab.example.org:5000", "https://127.0.0.1:5000", "http://127.0.0.1",
                      paste0("http://127.0.0.1:", free_port(), "/gym"))) {
    expect_unasked(elsewhere)
  }
  port <- free_port()
  socket <- serverSocket(port)
  expect_unasked(paste0("http://127.0.0.1:", port))
  close(socket)
  base <- paste0("http://127.0.0.1:", port)
  expect_unasked(base, config = httr::use_proxy("proxy", 80))
  withr::local_options(rlang_interactive = FALSE)
  expect_unasked(base)
  expect_length(asked$questions, 0)
})

test_that("asking for a server leaves R's generator alone", {
  skip_unless_all()
  skip_if_no_server()
  local_answers(list(TRUE))
  base <- paste0("http://127.0.0.1:", free_port())
  set.seed(1)
  before <- .Random.seed
  server <- create_GymClient(base)
  suppressMessages(env_list_all(server))
  withr::defer(gym_server_stop(server))
  expect_identical(.Random.seed, before)
})

test_that("an address of the other kind gets its server, too", {
  skip_unless_all()
  skip_if_no_server()
  base <- paste0("http://[::1]:", free_port())
  local_answers(list(TRUE))
  server <- create_GymClient(base)
  environments <- tryCatch(
    suppressMessages(env_list_all(server)),
    gym_error_server_start = function(cnd) skip("no IPv6 on this machine")
  )
  withr::defer(gym_server_stop(server))
  expect_type(environments, "list")
})
