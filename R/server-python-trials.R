# Whether Pythons can run the server, checked without starting it.

#' Try Pythons, all at once
#'
#' Each imports the whole server and prints its version.
#' @param pythons Paths of Pythons, a character vector.
#' @param timeout The time for all of them together, in seconds.
#' @return A data frame with one row for each: `python`, `version` (a string or `NA`), `runs`
#'   (logical, `NA` if it did not answer in time), `reason` (why it cannot run the server, a string
#'   or `NA`) and `extras` (the server's extras that it has, separated by ", ").
#' @noRd
try_pythons <- function(pythons, timeout = 6) {
  trials <- lapply(pythons, begin_trial)
  deadline <- now() + timeout
  outcomes <- Map(end_trial, pythons, trials, list(deadline))
  data.frame(
    python = pythons,
    version = vapply(outcomes, function(outcome) outcome$version, "", USE.NAMES = FALSE),
    runs = vapply(outcomes, function(outcome) outcome$runs, NA, USE.NAMES = FALSE),
    reason = vapply(outcomes, function(outcome) outcome$reason, "", USE.NAMES = FALSE),
    extras = vapply(outcomes, function(outcome) outcome$extras, "", USE.NAMES = FALSE)
  )
}

# The packages of each extra of the server.
extra_modules <- c(
  box2d = "Box2D", mujoco = "mujoco", atari = "ale_py", atari = "cv2", video = "moviepy"
)

# Python 2 has no `find_spec`, and its version must still be printed.
print_version <- paste0(
  "import sys; print('%d.%d.%d' % tuple(sys.version_info[:3])); sys.stdout.flush(); ",
  "import importlib.util as util; ",
  "print('modules ' + ' '.join(m for m in '", paste(extra_modules, collapse = " "),
  "'.split() if util.find_spec(m))); sys.stdout.flush(); "
)

extras_in <- function(modules) {
  has <- tapply(extra_modules %in% modules, factor(names(extra_modules), server_extras), all)
  paste(names(which(has)), collapse = ", ")
}

# Returns the running process and its output files, or NULL if it could not be started.
begin_trial <- function(python) {
  output <- temporary_file("gym-python-", fileext = c(".out", ".err"))
  process <- start_python(
    python, c("-c", paste0(print_version, run_server), "--version"),
    stdout = output[[1L]], stderr = output[[2L]], cleanup_tree = TRUE
  )
  if (!is.null(process)) list(process = process, output = output)
}

end_trial <- function(python, trial, deadline) {
  outcome <- function(version = NA_character_, runs = FALSE, reason = NA_character_) {
    list(version = version, runs = runs, reason = reason, extras = extras)
  }
  extras <- ""
  if (is.null(trial)) {
    return(outcome(reason = not_started_reason(python)))
  }
  on.exit(unlink(trial$output))
  await_end(trial$process, deadline - now())
  lines <- lapply(trial$output, log_tail)
  version <- grep("^[0-9.]+$", lines[[1L]], value = TRUE)[1L]
  extras <- extras_in(strsplit(grep("^modules", lines[[1L]], value = TRUE)[1L], " ")[[1L]])
  if (trial$process$is_alive()) {
    trial$process$kill_tree()
    outcome(version, NA, "it did not answer in time")
  } else if (identical(trial$process$get_exit_status(), 0L)) {
    outcome(version, TRUE)
  } else {
    outcome(version, FALSE, refusal_reason(lines[[2L]]))
  }
}
