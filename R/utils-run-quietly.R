# Programs that are run from R, and their ends.

#' Start a process with a tree id of its own
#'
#' processx finds a process's children by a tree id, which it draws from R's generator and the
#' current second. Where the generator is restored, or the user sets a seed, several processes would
#' have the same id, and killing one would kill the others. The generator is afterwards as it was.
#' @param code Starts a process.
#' @noRd
with_own_tree_id <- function(code) {
  load_processx()
  keep_random_state({
    set.seed(NULL)
    code
  })
}

# processx and the package parallel both handle SIGCHLD, the signal of ended children. When it is
# loaded processx reads from this variable whether to pass the signal on. If it does not, parallel
# waits at the session's end for forked children that ended long ago.
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
#' Polls the process, as the `wait()` of processx takes SIGCHLD from the package parallel, see
#' [load_processx()].
#' @param seconds How long at most.
#' @noRd
await_end <- function(process, seconds) {
  deadline <- proc.time()[["elapsed"]] + seconds
  while (process$is_alive() && proc.time()[["elapsed"]] < deadline) {
    Sys.sleep(0.01)
  }
}

#' Run a program that is only asked something
#'
#' R's generator stays as it was.
#' @param arguments A character vector.
#' @param timeout After how many seconds it is killed.
#' @return A list: `status`, `NA` for what could not be run or did not end in time, and `stdout`
#'   and `stderr`, strings, then empty.
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
