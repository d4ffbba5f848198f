# The session's own server, which all tests in this process share. The first test that needs it
# starts it, and it stops with the session.
test_client <- function() {
  skip_if_no_server()
  gym_client()
}

# Whether to run every test, as `make test-all` does, and not only those of `make test`.
tests_all <- function() identical(Sys.getenv("GYM_TEST_ALL"), "true")

# For a test that takes long, if another test proves its main promise.
skip_unless_all <- function() {
  testthat::skip_if_not(tests_all(), "left to make test-all")
}

# Whether a part of `make soak` runs, which sets this variable. For tests that take minutes.
soaks <- function(variable) identical(Sys.getenv(variable), "all")

skip_if_no_server <- function() {
  testthat::skip_if_not(
    can_start_server(), "no Python that can run the server (GYM_PYTHON names one)"
  )
}

# A Python that can run the server.
working_python <- function() {
  # Call this first, because it may start the server.
  client <- test_client()
  the_session$servers[[client$remote_base]]$python
}

# Starts a server for a test that stops it or needs other options.
local_server <- function(..., frame = parent.frame()) {
  skip_if_no_server()
  server <- gym_server_start(...)
  withr::defer(gym_server_stop(server), envir = frame)
  server
}

# An environment that is closed when the test ends.
local_env <- function(env_id = "CartPole-v1", ..., client = test_client(),
                      frame = parent.frame()) {
  env <- gym_make(env_id, ..., client = client)
  withr::defer(try(env$close(), silent = TRUE), envir = frame)
  env
}

# Starts a server that can make the environments of odd_environments.py and mirror_environments.py,
# for a test that stops it or needs other options. All other tests of a process share odd_server().
local_odd_server <- function(..., frame = parent.frame()) {
  withr::local_envvar(PYTHONPATH = paste(
    c(normalizePath(test_path()), Sys.getenv("PYTHONPATH")), collapse = .Platform$path.sep
  ))
  modules <- c("odd_environments", "mirror_environments")
  local_server(allow_module = modules, ..., frame = frame)
}

odd_server <- local({
  server <- NULL
  function() {
    if (is.null(server)) server <<- local_odd_server(frame = testthat::teardown_env())
    server
  }
})

make_odd <- function(name, server) {
  gym_make(paste0("odd_environments:", name, "-v0"), client = server)
}

# Runs a script of these tests, which serves on a free port and prints the port. Returns its
# address.
local_python_server <- function(script, ..., frame = parent.frame()) {
  process <- processx::process$new(
    working_python(), c(test_path(script), ...), stdin = "|", stdout = "|", stderr = NULL
  )
  withr::defer(process$kill(), envir = frame)
  port <- character()
  while (!length(port) && process$is_alive()) {
    process$poll_io(1000)
    port <- process$read_output_lines()
  }
  paste0("http://127.0.0.1:", port)
}

# The address of a server that hangs; see stalling_server.py.
local_stalling <- function(how, frame = parent.frame()) {
  local_python_server("stalling_server.py", how, frame = frame)
}

# The address of a server with wrong answers; see bad_server.py.
local_bad_server <- function(..., frame = parent.frame()) {
  local_python_server("bad_server.py", ..., frame = frame)
}

# A client of a server that has a fixed answer for each path. `say()` adds answers.
local_canned_server <- function(answers = list(), frame = parent.frame()) {
  file <- withr::local_tempfile(.local_envir = frame)
  writeLines(jsonlite::toJSON(answers, auto_unbox = TRUE), file)
  client <- create_GymClient(local_bad_server("canned", file, frame = frame), timeout = 10)
  # An earlier test may have started and stopped a server on this port.
  the_session$servers[[client$remote_base]] <- NULL
  client$file <- file
  client
}

say <- function(client, ...) {
  answers <- utils::modifyList(jsonlite::read_json(client$file), list(...))
  writeLines(jsonlite::toJSON(answers, auto_unbox = TRUE), client$file)
}

# A client whose connections to `server` are cut; see cutting_proxy.py.
local_cut_client <- function(server, when, pattern, times = 1, frame = parent.frame()) {
  port <- sub(".*:", "", server$remote_base)
  proxy <- local_python_server("cutting_proxy.py", port, when, pattern, times, frame = frame)
  create_GymClient(proxy, timeout = 10, token = token_of(server))
}

# A client of a server whose steps go by HTTP.
http_client <- function(client = test_client()) {
  create_GymClient(client$remote_base, config = httr::add_headers(a = "b"),
                   token = token_of(client))
}

# The token of a client's server, for another address of the server or another process.
token_of <- function(client) if (!is.null(client$token)) client$token()

# The tokens of two users, and a server with one for each of them.
user_tokens <- c(anna = "token-of-anna-0123456789", ben = "token-of-ben-0123456789")

local_users_server <- function(..., frame = parent.frame()) {
  skip_on_os("windows")
  file <- withr::local_tempfile(
    lines = paste(names(user_tokens), user_tokens), .local_envir = frame
  )
  Sys.chmod(file, "600")
  local_server(users = file, ..., frame = frame)
}

# A port on which nobody listens.
free_port <- function() {
  for (port in sample(20000:40000)) {
    socket <- tryCatch(serverSocket(port), error = function(cnd) NULL)
    if (!is.null(socket)) {
      close(socket)
      return(port)
    }
  }
}

pid_runs <- function(pid) {
  # Signal 0 only checks the process. A zombie has ended, and only its parent has not noticed yet.
  tools::pskill(pid, 0) &&
    !any(grepl("^State:\\s+Z", tryCatch(
      readLines(file.path("/proc", pid, "status")),
      error = function(cnd) "", warning = function(cnd) ""
    )))
}

# Kills a process after some seconds, while this one does something else.
kill_later <- function(pid, seconds, signal = 9L, frame = parent.frame()) {
  code <- sprintf("Sys.sleep(%f); tools::pskill(%d, %d)", seconds, pid, signal)
  killer <- processx::process$new(file.path(R.home("bin"), "Rscript"), c("--vanilla", "-e", code))
  withr::defer(killer$kill(), envir = frame)
}

# Runs a script in a new session with gym attached, in which `server` is a client of this session's
# server. Returns the result of processx::run().
run_session <- function(server, ..., timeout = 60) {
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"),
    "library(gym)",
    sprintf("server <- create_GymClient(\"%s\")", server$remote_base),
    ...
  ))
  processx::run(
    file.path(R.home("bin"), "Rscript"), script, timeout = timeout, error_on_status = FALSE,
    env = c("current", GYM_SERVER_TOKEN = token_of(server) %||% "")
  )
}

token_text <- "correct-horse-battery-staple"

# A file that holds the token.
local_token_file <- function(text = token_text, frame = parent.frame()) {
  file <- withr::local_tempfile(.local_envir = frame)
  writeLines(text, file)
  Sys.chmod(file, "600")
  file
}

# Starts a server that requires the token.
local_locked_server <- function(..., frame = parent.frame()) {
  local_server(token_file = local_token_file(frame = frame), ..., frame = frame)
}
