# The server as a process of this session: its start, its first lines of output, its end.

# Runs the server like `-m gym_server`, but takes the working directory out of Python's search path:
# a file random.py there would replace Python's own module.
run_server <- paste0(
  "import sys; sys.path[:] = [place for place in sys.path if place]; ",
  "import runpy; runpy.run_module('gym_server', run_name='__main__', alter_sys=True)"
)

# Tries to start the server with one Python. Without `token`, the server's arguments and the
# environment variable determine its token. Returns a description of the running server, or a string
# that says why this Python cannot run it.
launch_server <- function(python, arguments, timeout, token = NULL, call = rlang::caller_env()) {
  log <- temporary_file("gym-server-", fileext = ".log")
  use_python(python)
  process <- start_python(
    python, arguments, stdin = "|", stdout = "|", stderr = log, token = token,
    # With `cleanup`, processx or a forked child would kill the server. Instead, the session closes
    # the server's standard input. The server then closes its environments and ends.
    cleanup = FALSE
  )
  if (is.null(process)) {
    return(not_started_reason(python))
  }
  started <- await_start(process, log, timeout, call)
  if (!is.null(started)) {
    return(c(started, list(process = process, python = python, log = log, pid = process$get_pid())))
  }
  lines <- log_tail(log)
  own <- grep(server_line_start, lines, value = TRUE)
  if (length(own)) {
    in_r <- sub("--port 0 picks", "`gym_server_start()` without a port picks", own, fixed = TRUE)
    abort_server_start(
      "The server ended before it accepted connections.", in_r, call, port_hint(own[[1L]])
    )
  }
  refusal_reason(lines)
}

# Starts a Python that can import the server; `NULL` if that fails. The token is an environment
# variable, because other accounts can read the arguments of a process.
start_python <- function(python, arguments, ..., token = NULL) {
  variables <- server_environment()
  if (!is.null(token)) variables[[token_variable]] <- token()
  with_own_tree_id(tryCatch(
    processx::process$new(python, arguments, ..., env = variables, windows_hide_window = TRUE),
    error = function(cnd) NULL
  ))
}

# Why a Python could not be started. The system looks for a bare name on the PATH, so no file need
# exist.
not_started_reason <- function(python) {
  gone <- basename(python) != python && !file.exists(python)
  if (gone) "there is no such file" else "it cannot be run"
}

# Why a Python cannot run the server, from its output.
refusal_reason <- function(lines) {
  last <- utils::tail(c("it ended without output", lines[nzchar(lines)]), 1L)
  sub("^gym_server cannot run on this Python [(].*[)]: ", "", last)
}

# The server itself says why it cannot start in a line that begins like this. Other lines come from
# a Python that cannot run the server, or from another program with Python's name.
server_line_start <- "^(gym_server:|gym-http-server: error)"

# Which program has the server's port, if the server ended for that reason.
port_hint <- function(line) {
  parts <- regmatches(line, regexec("port ([0-9]+) on ([^ ]+) cannot be used", line))[[1L]]
  if (length(parts)) {
    host <- sub("^0[.]0[.]0[.]0$", "127.0.0.1", parts[[3L]])
    if (grepl(":", host)) host <- paste0("[", host, "]")
    port_holder(paste0("http://", host, ":", parts[[2L]]))
  }
}

server_environment <- function() {
  search_path <- c(system.file("server", package = "gym"), Sys.getenv("PYTHONPATH"))
  c(
    "current", PYTHONPATH = paste(search_path[nzchar(search_path)], collapse = .Platform$path.sep),
    PYTHONUNBUFFERED = "1",
    # R's library may belong to another user; write nothing there.
    PYTHONDONTWRITEBYTECODE = "1",
    PYTHON_CPU_COUNT = the_session$cores, own_library_path()
  )
}

# LD_LIBRARY_PATH without the folders that R put in front, where Python could find libraries of
# another Python.
own_library_path <- function() {
  path <- Sys.getenv("LD_LIBRARY_PATH")
  script <- file.path(R.home("etc"), "ldpaths")
  if (!nzchar(path) || !file.exists(script)) {
    return(NULL)
  }
  added <- run_quietly(
    "/bin/sh", c("-c", '. "$0" && printf %s "$LD_LIBRARY_PATH"', script),
    env = c("current", LD_LIBRARY_PATH = "")
  )$stdout
  # R that was started from R has them several times.
  while (nzchar(added) && startsWith(path, added)) {
    path <- sub("^:", "", substring(path, nchar(added) + 1L))
  }
  c(LD_LIBRARY_PATH = path)
}

# Waits until the server prints that it accepts connections. Returns a list with its address, `url`;
# NULL if the process ended first.
await_start <- function(process, log, timeout, call) {
  deadline <- now() + timeout
  lines <- character()
  repeat {
    left <- deadline - now()
    if (left <= 0) {
      process$kill()
      abort_server_start(
        paste0("The server did not start within ", timeout, " seconds."), log_tail(log), call,
        "`gym_server_start(timeout = )` gives it longer."
      )
    }
    process$poll_io(as.integer(ceiling(left * 1000)))
    lines <- c(lines, process$read_output_lines())
    said <- lines[startsWith(lines, "Server starting at: ")]
    if (length(said)) {
      address <- sub("Server starting at: ", "", said[[1L]], fixed = TRUE)
      # A server that listens on all addresses also listens on the loopback address.
      return(list(url = sub("//0.0.0.0:", "//127.0.0.1:", address, fixed = TRUE)))
    }
    if (!process$is_incomplete_output()) {
      await_end(process, 5)
      return(NULL)
    }
  }
}

log_tail <- function(log, n = 20L) {
  utils::tail(if (file.exists(log)) readLines(log, warn = FALSE) else character(), n)
}

# Why a process has ended, as text; `NULL` if it was stopped. The server writes the reason into its
# log, or Python does if the server cannot. `less` advises how to use less memory.
end_reason <- function(process, log, less = paste(
  "fewer or smaller environments take less, and `gym_server_start(max_memory_mb = )` is the limit."
)) {
  lines <- log_tail(log, 10000L)
  said <- grep(" CRITICAL ", lines, fixed = TRUE, value = TRUE)
  python <- grep("^(Timeout [(]|Fatal Python error)", lines, value = TRUE)
  status <- process$get_exit_status() %||% 0L
  # On Windows a status below 0 has other meanings.
  signal <- if (status < 0L && status > -65L) paste("signal", -status)
  if (length(said)) {
    sentence(sub("^.*? CRITICAL [^ ]+: ", "", utils::tail(said, 1L), perl = TRUE))
  } else if (length(python) && startsWith(python[[1L]], "Timeout")) {
    "C code held Python's lock for longer than the server's `max_call_seconds`."
  } else if (any(grepl("^[^ ]* ?terminat.*bad_alloc", lines))) {
    # C++ prints this when memory runs out, and aborts.
    paste("The system gave it no more memory:", less)
  } else if (length(python)) {
    crash <- c(sub("^Fatal Python error: ", "", python[[1L]]), signal)
    paste0("It crashed: ", paste(crash, collapse = ", "), ".")
  } else if (status == -9L) {
    paste("It was killed, as systems do when memory runs out:", less)
  } else if (status != 0L) {
    how <- if (is.null(signal)) "Its exit status is " else "It was ended by "
    paste(c(paste0(how, signal %||% status, "."), utils::tail(lines, 3L)), collapse = "\n")
  }
}

abort_server_start <- function(message, log_lines, call, hint = NULL) {
  gym_abort(
    c(message, x = if (length(log_lines)) paste(log_lines, collapse = "\n"), i = hint),
    class = "gym_error_server_start", log = log_lines, call = call
  )
}

stop_server <- function(server, timeout = 15) {
  process <- server$process
  forget_instances_of(server$url)
  if (!process$is_alive()) {
    return(invisible())
  }
  close_server_input(server)
  await_end(process, 1)
  terminate_server(server)
  await_end(process, timeout)
  if (process$is_alive()) process$kill()
}

# Closes the server's standard input, which stops it.
close_server_input <- function(server) {
  # It is already closed if an earlier stop was interrupted.
  try(close(server$process$get_input_connection()), silent = TRUE)
}

# Stops the server by a signal: while a forked child of this session lives, the server's standard
# input stays open. A server that was paused by SIGSTOP receives SIGTERM only when it continues.
terminate_server <- function(server) {
  if (server$process$is_alive() && !is_windows()) {
    server$process$signal(tools::SIGTERM)
    server$process$signal(tools::SIGCONT)
  }
}

# What listens at an address --------------------------------------------------------------

#' Find out what listens at an address
#'
#' This sends no token, because the program may not be a Gym server.
#' @param timeout The time for the answer, in seconds. A server that accepts connections but does
#'   not answer in time still counts as listening.
#' @return A list of `listens` and `is_gym` (logical) and `name` (the name that the program gives
#'   itself, a string or `NULL`).
#' @noRd
probe_server <- function(base, timeout) {
  client <- new_client(base, timeout, httr::config(forbid_reuse = TRUE))
  response <- tryCatch(
    with_answer(send_request(client, "/v1/envs/", "GET")), gym_error_connection = identity
  )
  answer <- response$answer
  list(
    listens = !isFALSE(response$reached),
    is_gym = !is.null(answer$all_envs) || identical(answer$code, "unauthorized"),
    name = server_name(response)
  )
}

#' Say which program has the port of a server
#' @return A sentence, `NULL` if nothing seems to listen there.
#' @noRd
port_holder <- function(base) {
  holder <- probe_server(base, timeout = 2)
  if (!holder$listens) {
    return(NULL)
  }
  use <- paste0("`create_GymClient(\"", base, "\")` talks to it")
  if (is_running(base)) {
    paste0("This session's own server has it: ", use, ".")
  } else if (holder$is_gym) {
    paste0("A Gym server has it: ", use, ".")
  } else if (is.null(holder$name)) {
    "Another program has it. `gym_server_start()` without a port uses a free one."
  } else {
    foreign_server_hint(base, holder$name)
  }
}

# Which Python runs the server -------------------------------------------------------------------

# Where to look for a Python, and the error if none can run the server.

#' Say that no Python can run the server
#' @param refusals Why each tried Python cannot run the server: strings, named by the paths of the
#'   Pythons.
#' @noRd
abort_no_python <- function(python, refusals, call = rlang::caller_env()) {
  named <- named_python(python)
  own <- refusals[names(refusals) %in% installed_server()$python]
  message <- if (!is.null(named)) {
    # For users who chose a Python.
    by <- if (is.null(python)) "GYM_PYTHON" else "`python`"
    unset <- if (is.null(python)) " (`Sys.unsetenv(\"GYM_PYTHON\")`)"
    c(
      paste0("The Python that ", by, " names cannot run the server."),
      x = paste0(named, ": ", refusals),
      i = if (any(grepl("No module named", refusals, fixed = TRUE))) {
        paste("To install what it lacks, run in a terminal:",
              pip_install_server(quote_for_terminal(named)))
      },
      i = paste0("Without ", by, unset, " the session uses the one that ",
                 "`gym::gym_server_install()` installs.")
    )
  } else if (length(own)) {
    # For users who do not know Python; gym_sitrep() has the details.
    c("The Python that was installed for the server cannot run it.",
      x = paste0(names(own), ": ", own), i = "`gym::gym_server_install()` installs it again.")
  } else {
    c("The server needs a Python of its own, which is not installed yet.",
      i = "`gym::gym_server_install()` installs it.",
      i = if (!rlang::is_interactive()) {
        "With the environment variable GYM_INSTALL=1, a script installs it by itself."
      })
  }
  gym_abort(message, class = "gym_error_server_start", refusals = refusals, call = call)
}

# The command by which a Python installs the server.
pip_install_server <- function(python) {
  folder <- normalizePath(system.file("server", package = "gym"))
  paste(python, "-m pip install", quote_for_terminal(folder))
}

#' Find out whether a Python can run the server
#'
#' It imports the whole server and prints its version.
#' @param timeout The time for that, in seconds.
#' @param before Lines of Python to run first, a string.
#' @return A string that says why it cannot, or `NULL`.
#' @noRd
python_problem <- function(python, timeout = 60, before = "") {
  run <- run_quietly(
    python, c("-c", paste0(before, run_server), "--version"), timeout, server_environment()
  )
  if (is.na(run$status)) {
    return(paste0(not_started_reason(python), ", or does not answer in ", timeout, " s"))
  }
  # An empty executable file also ends with status 0.
  if (run$status != 0L || !nzchar(run$stdout)) refusal_reason(strsplit(run$stderr, "\n")[[1L]])
}

quote_for_terminal <- function(path) shQuote(path, if (is_windows()) "cmd" else "sh")

# The Python that the user chose, or NULL.
named_python <- function(python) {
  named <- python %||% Sys.getenv("GYM_PYTHON")
  if (nzchar(named)) path.expand(named)
}

# Where Python may be, in the order of the trials.
python_candidates <- function(python = NULL) {
  named <- named_python(python)
  if (!is.null(named)) {
    return(named)
  }
  active <- Sys.getenv(c("VIRTUAL_ENV", "CONDA_PREFIX"), names = FALSE)
  folder <- if (is_windows()) c("Scripts", ".") else "bin"
  places <- file.path(rep(active[nzchar(active)], each = length(folder)), folder)
  path <- strsplit(Sys.getenv("PATH"), .Platform$path.sep, fixed = TRUE)[[1L]]
  # In the folder WindowsApps, python is a program that only opens the Store.
  path <- grep("WindowsApps", path[nzchar(path)], value = TRUE, invert = TRUE)
  if (lacks_developer_tools()) path <- setdiff(path, "/usr/bin")
  found <- c(pythons_in(places), installed_server()$python, pythons_in(path))
  # Also compare folders: the Python of an environment may be a link to another Python, which lacks
  # the environment's packages.
  found[!duplicated(paste(normalizePath(dirname(found)), normalizePath(found)))]
}

pythons_in <- function(places) {
  commands <- paste0(c("python3", "python"), if (is_windows()) ".exe")
  found <- file.path(rep(places, each = length(commands)), rep(commands, length(places)))
  found[file.access(found, 1L) == 0L]
}

# Without the developer tools /usr/bin/python3 of macOS only opens a dialog.
lacks_developer_tools <- function() {
  Sys.info()[["sysname"]] == "Darwin" &&
    !identical(run_quietly("/usr/bin/xcode-select", "-p", timeout = 5)$status, 0L)
}
