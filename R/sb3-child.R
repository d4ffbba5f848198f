# Runs a child process: a Python that has Stable-Baselines3. R and the child exchange plain files.
# To stop the child, R closes the child's standard input.

sb3_modules <- c("torch", "stable_baselines3", "sb3_contrib")

# Finds a Python with Stable-Baselines3: that of the session's server, or another that gym_client()
# would use. It looks for the modules without importing them, because importing takes seconds.
sb3_python <- function(call) {
  running <- lapply(the_session$servers, function(server) server$python)
  pythons <- unique(c(unlist(running, use.names = FALSE), python_candidates()))
  code <- paste0(
    "import sys; from importlib.util import find_spec; sys.exit(not all(map(find_spec, (",
    paste0("'", sb3_modules, "'", collapse = ", "), "))))"
  )
  Find(function(python) {
    identical(run_quietly(python, c("-c", code), env = server_environment())$status, 0L)
  }, pythons) %||% abort_no_sb3(call)
}

abort_no_sb3 <- function(call) {
  named <- named_python(NULL)
  gym_abort(
    c("Stable-Baselines3 and PyTorch are not installed in the server's Python.",
      i = if (is.null(named)) {
        "`gym_server_install(extras = \"sb3\")` installs them."
      } else {
        paste0("GYM_PYTHON names ", named, ". In a terminal: ", quote_for_terminal(named),
               " -m pip install stable-baselines3 sb3-contrib")
      }),
    class = "gym_error_install", call = call
  )
}

run_sb3 <- function() sub("'gym_server'", "'gym_server.sb3'", run_server, fixed = TRUE)

#' Run a job in a child process
#'
#' The child ends at its next step when its standard input is closed. This happens if the user
#' interrupts R, and also if R is killed.
#' @param job The job, a list. Its `task` is `"train"`, `"convert"`, `"play"` or `"act"`.
#' @param folder The folder of its files.
#' @param poll A function that is called several times a second.
#' @return A list: the contents of `result.json`, which the job writes, and `interrupted`.
#' @noRd
run_sb3_job <- function(job, folder, python, call, poll = function() NULL) {
  file <- file.path(folder, "job.json")
  log <- file.path(folder, "output.log")
  unlink(file.path(folder, "result.json"))
  replace_content(file, as_lines(to_json(job)))
  use_python(python)
  process <- start_python(
    python, c("-c", run_sb3(), file), stdin = "|", stdout = log, stderr = "2>&1", cleanup = FALSE
  )
  if (is.null(process)) {
    gym_abort(paste0(python, ": ", not_started_reason(python), "."),
              class = "gym_error_server_start", call = call)
  }
  on.exit(if (process$is_alive()) process$kill())
  interrupted <- tryCatch(
    {
      while (process$is_alive()) {
        Sys.sleep(0.1)
        poll()
      }
      FALSE
    },
    interrupt = function(cnd) {
      end_child(process)
      TRUE
    }
  )
  result <- file.path(folder, "result.json")
  if (!file.exists(result)) abort_child(process, log, call)
  c(read_json_file(result), interrupted = interrupted)
}

read_bytes <- function(file) readBin(file, "raw", file.size(file))

read_json_file <- function(file) from_json(paste(readLines(file, warn = FALSE), collapse = "\n"))

# Waits until the child has finished its step, which may be the update after a long rollout, or a
# whole episode. A second interrupt stops waiting and kills the child.
end_child <- function(process) {
  cli::cli_inform(c(i = "Ending it as soon as possible."))
  close_server_input(list(process = process))
  terminate_server(list(process = process))
  await_end(process, Inf)
}

abort_child <- function(process, log, call) {
  less <- "a smaller `buffer_size`, `batch_size` or `num_envs` takes less."
  gym_abort(
    c("The process of Stable-Baselines3 ended without a result.",
      x = end_reason(process, log, less),
      i = "With a `checkpoint` the same call goes on from the last evaluation."),
    class = "gym_error_training", call = call
  )
}

# Makes an R error of an error that the job reports: of an argument, or during training.
sb3_error <- function(error, call) {
  known <- unlist(error$known)
  named <- regmatches(error$message, regexpr("(?<=\")[^\"]+(?=\")", error$message, perl = TRUE))
  near <- if (length(known)) did_you_mean(c(named, error$argument)[[1L]], known)
  tryCatch(
    gym_abort(
      c(error$message, i = error$hint, i = near,
        i = if (length(known) && is.null(near)) paste0("There are ", quoted_names(known), ".")),
      class = if (!is.null(error$argument)) {
        "gym_error_argument"
      } else if (isTRUE(error$checkpoint)) {
        "gym_error_checkpoint"
      } else {
        "gym_error_training"
      },
      argument = error$argument, call = call
    ),
    error = identity
  )
}
