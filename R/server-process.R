# The server as a process of this session's: its start, its first words, its end.

# As `-m gym_server`, but without the working directory among the places of modules,
# where a file named random.py would take the place of Python's own.
run_server <- paste0(
  "import sys; sys.path[:] = [place for place in sys.path if place]; ",
  "import runpy; runpy.run_module('gym_server', run_name='__main__', alter_sys=True)"
)

# Start the server with one Python. Returns what is known of the running server,
# or a string that says why this Python cannot run it.
launch_server <- function(python, arguments, timeout, call = rlang::caller_env()) {
  log <- tempfile("gym-server-", fileext = ".log")
  use_python(python)
  process <- with_own_mark(tryCatch(
    processx::process$new(
      python, arguments,
      stdin = "|", stdout = "|", stderr = log,
      env = server_environment(),
      # The closing of its standard input ends the server, which also lets it
      # close its environments and cannot be done by a forked child.
      cleanup = FALSE, windows_hide_window = TRUE
    ),
    error = function(cnd) NULL
  ))
  if (is.null(process)) {
    return(not_run_words(python))
  }
  url <- await_start(process, log, timeout, call)
  if (!is.null(url)) {
    return(list(url = url, process = process, python = python, log = log, pid = process$get_pid()))
  }
  words <- log_tail(log)
  own <- grep(server_words, words, value = TRUE)
  if (length(own)) {
    in_r <- sub("--port 0 takes", "`gym_server_start()` without a port takes", own, fixed = TRUE)
    abort_server_start(
      "The server ended before it took connections.", in_r, call, port_hint(own[[1L]])
    )
  }
  refusal_words(words)
}

# Why nothing at all came of a Python. A bare name is looked for on the PATH.
not_run_words <- function(python) {
  if (basename(python) != python && !file.exists(python)) {
    "there is no such file"
  } else {
    "it cannot be run"
  }
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
  added <- run_quietly(
    "/bin/sh", c("-c", '. "$0" && printf %s "$LD_LIBRARY_PATH"', script),
    env = c("current", LD_LIBRARY_PATH = "")
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
        paste0("The server did not start within ", timeout, " seconds."), log_tail(log), call,
        "`gym_server_start(timeout = )` gives it longer."
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
      await_end(process, 5)
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

stop_server <- function(server, patience = 15) {
  process <- server$process
  unregister_created_on(server$url)
  if (!process$is_alive()) {
    return(invisible())
  }
  close_server_input(server)
  await_end(process, 1)
  terminate_server(server)
  await_end(process, patience)
  if (process$is_alive()) {
    process$kill()
  }
}

close_server_input <- function(server) {
  input <- server$process$get_input_connection()
  # A stop that was interrupted has closed it.
  tryCatch(close(input), error = function(cnd) NULL)
}

# A forked child that still lives holds the server's standard input open, too; one that was
# stopped hears of nothing until it goes on.
terminate_server <- function(server) {
  if (server$process$is_alive() && !is_windows()) {
    server$process$signal(tools::SIGTERM)
    server$process$signal(tools::SIGCONT)
  }
}
