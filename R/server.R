# Local servers: started by this session, ended with it. The server ends when its
# standard input closes, which happens however the R session ends.

#' Use the session's server
#'
#' Returns the client that functions take when they are given none. It talks to
#' the server that the environment variable `GYM_SERVER_URL` names or, without
#' it, to one on this machine, which is started at the first call and stops with
#' the session.
#'
#' @inheritSection gym_server_start Where there is no Python
#' @return A client, as [create_GymClient()] makes it.
#' @section Errors: `gym_error_server_start` when no server could be started.
#' @export
#' @examplesIf gym:::can_start_server()
#' gym_client()
gym_client <- function() {
  session_client()
}

# `install` as start_server() takes it.
session_client <- function(install = TRUE, call = rlang::caller_env()) {
  url <- Sys.getenv("GYM_SERVER_URL")
  if (nzchar(url)) {
    return(named_client(url, call))
  }
  if (is.null(the_session$client) || !is_running(the_session$client$remote_base)) {
    the_session$client <- start_server(install = install, call = call)
  }
  the_session$client
}

# One client for all calls, so that they share its connection.
named_client <- function(url, call = rlang::caller_env()) {
  if (!grepl("^https?://[^/]", url)) {
    gym_abort(
      paste0("The variable GYM_SERVER_URL must be the address of a server, such as ",
             "\"http://127.0.0.1:5000\", not \"", url, "\"."),
      class = "gym_error_argument",
      call = call
    )
  }
  if (!identical(the_session$named_url, url)) {
    the_session$named_client <- new_client(url)
    the_session$named_url <- url
  }
  the_session$named_client
}

# In a forked child the parent's server is as good as its own.
is_running <- function(base) {
  server <- the_session$servers[[base]]
  !is.null(server) && (Sys.getpid() != the_session$pid || server$process$is_alive())
}

#' Start a server on this machine
#'
#' Starts the server that comes with the package as a process of its own and
#' waits until it takes connections. It stops with the R session, also when that
#' is killed.
#'
#' Python is looked for in `python`; in the environment variable `GYM_PYTHON`; in
#' an active virtual environment (`VIRTUAL_ENV`, `CONDA_PREFIX`); where
#' [gym_server_install()] has put it; on the `PATH`.
#' The first that can run the server is taken. Where `python` or `GYM_PYTHON`
#' names one, no other is tried. [gym_sitrep()] shows what comes of it.
#'
#' @section Where there is no Python:
#' Without a Python that can run the server an interactive session offers once to
#' install one, by [gym_server_install()], and goes on with what was asked for. A
#' script stops and says so, or, with the environment variable `GYM_INSTALL=1`,
#' installs it without asking. Where `python` or `GYM_PYTHON` names a Python nothing
#' is installed.
#' @param port The port to listen on, a whole number; `NULL`, the default, takes
#'   a free one.
#' @param python Path of a Python 3.10 or newer, a string, or `NULL`.
#' @param ... Further options of the server, by name: `monitor_dir = "runs"` is
#'   its `--monitor-dir runs`. `log_level = "info"` logs what is made and closed,
#'   `allow_module = c("a", "b")` names Python modules whose environments may be
#'   made.
#' @param timeout How long the start may take, in seconds; the default is 60.
#' @return A client for the server, as [create_GymClient()] makes it.
#' @section Errors: `gym_error_server_start`, with the server's own words: no
#'   Python can run it, the port is taken, it did not start in time;
#'   `gym_error_argument`.
#' @seealso [gym_server_stop()], [gym_server_log()], [gym_client()]
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' env_list_all(server)
#' gym_server_stop(server)
gym_server_start <- function(port = NULL, python = NULL, ..., timeout = 60) {
  check_count(port, min = 0, max = 65535, allow_null = TRUE)
  check_string(python, allow_null = TRUE)
  check_number(timeout, min = 0.001)
  start_server(port, python, list(...), timeout)
}

#' Start a server with the first Python that can run it
#' @param install May a Python environment be installed, or offered, when no Python can?
#' @return A client for the server.
#' @noRd
start_server <- function(port = NULL, python = NULL, options = list(), timeout = 60,
                         install = TRUE, call = rlang::caller_env()) {
  arguments <- c(
    "-c", run_server, "--stop-on-stdin-eof", "--port", sprintf("%.0f", port %||% 0),
    server_options(options, call)
  )
  refusals <- character()
  for (candidate in python_candidates(python)) {
    server <- launch_server(candidate, arguments, timeout, call)
    if (is.list(server)) {
      return(register_server(server))
    }
    refusals[[candidate]] <- server
  }
  installed <- if (install && is.null(named_python(python))) offered_python()
  if (!is.null(installed)) {
    server <- launch_server(installed, arguments, timeout, call)
    if (is.list(server)) {
      return(register_server(server))
    }
    refusals[[installed]] <- server
  }
  abort_no_python(python, refusals, call)
}

register_server <- function(server) {
  the_session$servers[[server$url]] <- server
  new_client(server$url)
}

# As `-m gym_server`, but without the working directory among the places of modules,
# where a file named random.py would take the place of Python's own.
run_server <- paste0(
  "import sys; sys.path[:] = [place for place in sys.path if place]; ",
  "import runpy; runpy.run_module('gym_server', run_name='__main__', alter_sys=True)"
)

# Extra options as the command line takes them: log_level = "info" becomes
# --log-level info, TRUE a flag, a vector one option for each element.
server_options <- function(options, call = rlang::caller_env()) {
  check_dots_named(options, "log_level = \"info\"", call = call)
  flags <- paste0("--", gsub("_", "-", names(options)))
  unlist(Map(
    function(flag, values) {
      if (isTRUE(values)) {
        flag
      } else if (length(values) && !isFALSE(values)) {
        as.vector(rbind(flag, as.character(values)))
      }
    },
    flags, options
  ), use.names = FALSE)
}

# Start the server with one Python. Returns what is known of the running server,
# or a string that says why this Python cannot run it.
launch_server <- function(python, arguments, timeout, call = rlang::caller_env()) {
  log <- tempfile("gym-server-", fileext = ".log")
  use_python(python)
  # processx draws a name from R's generator.
  process <- keep_random_state(tryCatch(
    processx::process$new(
      python, arguments,
      stdin = "|", stdout = "|", stderr = log,
      env = server_environment(),
      # The closing of its standard input ends the server, which also lets it
      # close its environments and cannot be done by a forked child.
      cleanup = FALSE, windows_hide_window = TRUE
    ),
    error = function(cnd) conditionMessage(cnd)
  ))
  if (is.character(process)) {
    return("it cannot be run")
  }
  url <- await_start(process, log, timeout, call)
  if (!is.null(url)) {
    return(list(url = url, process = process, python = python, log = log, pid = process$get_pid()))
  }
  words <- log_tail(log)
  own <- grep(server_words, words, value = TRUE)
  if (length(own)) {
    abort_server_start(
      "The server ended before it took connections.", own, call, port_hint(own[[1L]])
    )
  }
  refusal_words(words)
}

# Why a Python cannot run the server, from the lines that it wrote.
refusal_words <- function(lines) {
  lines <- lines[nzchar(lines)]
  if (!length(lines)) {
    return("it ended without a word")
  }
  sub("^gym_server cannot run on this Python [(].*[)]: ", "", utils::tail(lines, 1L))
}

# How the server itself begins when it cannot start as it was asked to; whatever else
# is said comes from a Python that cannot run it, or from what only looks like one.
server_words <- "^(gym_server:|gym-http-server: error)"

# Who has the port that the server could not have, when that was why it ended.
port_hint <- function(words) {
  parts <- regmatches(words, regexec("port ([0-9]+) on ([^ ]+) cannot be used", words))[[1L]]
  if (length(parts)) {
    host <- sub("^0[.]0[.]0[.]0$", "127.0.0.1", parts[[3L]])
    port_holder(paste0("http://", if (grepl(":", host)) paste0("[", host, "]") else host, ":",
                       parts[[2L]]))
  }
}

server_environment <- function() {
  search_path <- c(system.file("server", package = "gym"), Sys.getenv("PYTHONPATH"))
  c(
    "current",
    PYTHONPATH = paste(search_path[nzchar(search_path)], collapse = .Platform$path.sep),
    PYTHONUNBUFFERED = "1",
    # R's library may be another user's; nothing is written there.
    PYTHONDONTWRITEBYTECODE = "1",
    own_library_path()
  )
}

# What LD_LIBRARY_PATH was before R's start put its own folders in front, where Python
# would find the libraries of another Python.
own_library_path <- function() {
  path <- Sys.getenv("LD_LIBRARY_PATH")
  script <- file.path(R.home("etc"), "ldpaths")
  if (!nzchar(path) || !file.exists(script)) {
    return(NULL)
  }
  added <- processx::run(
    "/bin/sh", c("-c", '. "$0" && printf %s "$LD_LIBRARY_PATH"', script),
    env = c("current", LD_LIBRARY_PATH = ""), error_on_status = FALSE
  )$stdout
  # More than once where R has started R.
  while (nzchar(added) && startsWith(path, added)) {
    path <- sub("^:", "", substring(path, nchar(added) + 1L))
  }
  c(LD_LIBRARY_PATH = path)
}

# Wait for the line by which the server says that it takes connections. Returns
# its address, NULL when the process ended first.
await_start <- function(process, log, timeout, call) {
  deadline <- Sys.time() + timeout
  repeat {
    left <- as.numeric(deadline - Sys.time(), units = "secs")
    if (left <= 0) {
      process$kill()
      abort_server_start(
        paste0("The server did not start within ", timeout, " seconds."), log_tail(log), call
      )
    }
    process$poll_io(as.integer(ceiling(left * 1000)))
    lines <- process$read_output_lines()
    address <- grep("^Server starting at: ", lines, value = TRUE)
    if (length(address)) {
      # A server that listens on all addresses is reached by this machine's own.
      address <- sub("//0.0.0.0:", "//127.0.0.1:", address[1L], fixed = TRUE)
      return(sub("^Server starting at: ", "", address))
    }
    if (!process$is_incomplete_output()) {
      process$wait(5000)
      return(NULL)
    }
  }
}

log_tail <- function(log, n = 20L) {
  if (!file.exists(log)) {
    return(character())
  }
  utils::tail(readLines(log, warn = FALSE), n)
}

abort_server_start <- function(message, log_lines, call, hint = NULL) {
  gym_abort(
    c(message, x = if (length(log_lines)) paste(log_lines, collapse = "\n"), i = hint),
    class = "gym_error_server_start",
    log = log_lines,
    call = call
  )
}

#' Stop a server that this session started
#'
#' The server finishes the calls under way and closes its environments; one that
#' does not end within 15 seconds is killed.
#'
#' @param server The client that [gym_server_start()] returned; `NULL`, the
#'   default, stands for the session's own server, that of [gym_client()].
#' @return Nothing, invisibly. Stopping a server twice does no harm.
#' @section Errors: `gym_error_argument` for a server that this session did not
#'   start.
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' gym_server_stop(server)
gym_server_stop <- function(server = NULL) {
  stop_server(session_server(server))
  invisible()
}

#' Read a server's log
#'
#' Warnings and errors of a server that this session started, and what its
#' environments print; also after its end.
#'
#' @inheritParams gym_server_stop
#' @return A character vector, one element a line; `character(0)` when the server
#'   had nothing to say.
#' @inheritSection gym_server_stop Errors
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start(log_level = "info")
#' gym_server_log(server)
#' gym_server_stop(server)
gym_server_log <- function(server = NULL) {
  log_tail(session_server(server)$log, n = Inf)
}

session_server <- function(client, call = rlang::caller_env()) {
  client <- client %||% the_session$client
  if (is.null(client)) {
    gym_abort(
      "This session has started no server.", class = "gym_error_argument", call = call
    )
  }
  check_client(client, arg = "server", call = call)
  the_session$servers[[client$remote_base]] %||% gym_abort(
    c(
      paste0("The server at ", client$remote_base, " was not started by this session."),
      i = "`shutdown_server()` stops any server."
    ),
    class = "gym_error_argument",
    call = call
  )
}

stop_server <- function(server, patience = 15) {
  process <- server$process
  if (!process$is_alive()) {
    return(invisible())
  }
  close(process$get_input_connection())
  process$wait(1000)
  if (process$is_alive() && !is_windows()) {
    # A forked child that still lives holds the server's standard input open, too.
    process$signal(tools::SIGTERM)
  }
  process$wait(patience * 1000)
  if (process$is_alive()) {
    process$kill()
  }
}

# At the end of the session; a forked child's end is not the session's.
stop_session_servers <- function(session) {
  if (Sys.getpid() != session$pid) {
    return()
  }
  for (server in session$servers) {
    stop_server(server, patience = 2)
  }
}

# For the examples: whether the session has a server or can have one, as things are.
can_start_server <- function() {
  tryCatch(
    inherits(session_client(install = FALSE), "GymClient"),
    gym_error_server_start = function(cnd) FALSE
  )
}
