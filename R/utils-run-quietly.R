# Run programs from R and wait for them.

#' Start a process with its own tree id
#'
#' processx finds the children of a process by a tree id, which it derives from R's generator and
#' the current second. If the generator is restored or the user sets a seed, several processes could
#' have the same id, and killing one would kill the others. The generator is restored afterwards.
#' @param code Starts a process.
#' @noRd
with_own_tree_id <- function(code) {
  load_processx()
  keep_random_state({
    set.seed(NULL)
    code
  })
}

# processx and the package parallel both handle SIGCHLD, the signal of ended children. On loading,
# processx reads from this variable whether to pass the signal on. If it does not, parallel waits at
# the end of the session for forked children that ended long ago.
load_processx <- function() {
  variable <- "PROCESSX_NOTIFY_OLD_SIGCHLD"
  if (!isNamespaceLoaded("processx") && !nzchar(Sys.getenv(variable))) {
    do.call(Sys.setenv, stats::setNames(list("true"), variable))
    on.exit(Sys.unsetenv(variable))
    loadNamespace("processx")
  }
}

#' Wait for a process to end
#'
#' Polls the process, because `wait()` of processx takes SIGCHLD from the package parallel, see
#' [load_processx()].
#' @param seconds The longest time to wait.
#' @noRd
# In seconds.
now <- function() proc.time()[["elapsed"]]

await_end <- function(process, seconds) {
  deadline <- now() + seconds
  while (process$is_alive() && now() < deadline) {
    Sys.sleep(0.01)
  }
}

#' Run a program and return its output
#'
#' R's generator is left as it was.
#' @param arguments A character vector.
#' @param timeout The time after which it is killed, in seconds.
#' @return A list: `status`, `NA` if it could not be run or did not end in time, and `stdout` and
#'   `stderr`, strings, which are then empty.
#' @noRd
run_quietly <- function(command, arguments, timeout = 30, env = NULL) {
  silent <- list(status = NA_integer_, stdout = "", stderr = "")
  run <- with_own_tree_id(tryCatch(
    processx::run(
      command, arguments,
      timeout = timeout, env = env, error_on_status = FALSE, cleanup_tree = TRUE,
      windows_hide_window = TRUE
    ),
    error = function(cnd) silent
  ))
  if (isTRUE(run$timeout)) silent else run[c("status", "stdout", "stderr")]
}
