# Processes that the benchmark starts: contenders that play a turn on request, and the development
# server of the classic pattern. All end with the benchmark.

start_worker <- function(command, arguments, env = character()) {
  log <- tempfile("bench-")
  process <- processx::process$new(
    command, arguments, stdin = "|", stdout = "|", stderr = log, env = c("current", env)
  )
  list(process = process, log = log)
}

# Sends a line to a worker and waits for its answer.
ask <- function(worker, ...) {
  worker$process$write_input(paste0(paste(...), "\n"))
  repeat {
    worker$process$poll_io(-1)
    line <- worker$process$read_output_lines(1)
    if (length(line)) {
      return(jsonlite::fromJSON(line))
    }
    if (!worker$process$is_incomplete_output()) {
      stop("A contender ended:\n", paste(readLines(worker$log), collapse = "\n"), call. = FALSE)
    }
  }
}

start_python <- function(python) {
  start_worker(python, "tools/bench/in_process.py")
}

# `numpy` is a folder with another NumPy than the server's, or `NULL`.
start_reticulate <- function(numpy, python) {
  path <- c(numpy, Filter(nzchar, Sys.getenv("PYTHONPATH")))
  start_worker(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", "tools/bench/reticulate.R"),
    c(RETICULATE_PYTHON = python, PYTHONPATH = paste(path, collapse = .Platform$path.sep))
  )
}

# The server on Flask's development server, which closes each connection, as the classic client's
# server did.
start_development_server <- function(python) {
  script <- c(
    "from gym_server.api.app import create_app",
    "create_app().run(host='127.0.0.1', port=0, threaded=True)"
  )
  server <- start_worker(
    python, c("-c", paste(script, collapse = "\n")),
    c(PYTHONPATH = system.file("server", package = "gym"))
  )
  repeat {
    line <- grep("Running on", readLines(server$log), value = TRUE)
    if (length(line)) break
    if (!server$process$is_alive()) {
      stop("The development server ended:\n", paste(readLines(server$log), collapse = "\n"))
    }
    Sys.sleep(0.1)
  }
  server$url <- sub(".*(http://[0-9.:]+).*", "\\1", line[1L])
  server
}

end_worker <- function(worker) worker$process$kill()
