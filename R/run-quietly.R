# Programs that are run from R.

#' Start a process with a mark of its own
#'
#' processx draws the mark by which it finds a process's children from R's generator, and adds the
#' second: where the generator is put back, or the user sets a seed, processes would share it, and
#' the end of one would end the others. The generator is afterwards as it was.
#' @param code Starts a process.
#' @noRd
with_own_mark <- function(code) {
  keep_random_state({
    set.seed(NULL)
    code
  })
}

#' Run a program that is only asked something
#'
#' R's generator stays as it was.
#' @param arguments A character vector.
#' @param timeout After how many seconds it is ended.
#' @return A list: `status`, `NA` for what could not be run or did not end in time, and `stdout`,
#'   a string, then empty.
#' @noRd
run_quietly <- function(command, arguments, timeout = 30, env = NULL) {
  silent <- list(status = NA_integer_, stdout = "")
  run <- with_own_mark(tryCatch(
    processx::run(
      command, arguments,
      timeout = timeout, env = env, error_on_status = FALSE, cleanup_tree = TRUE,
      windows_hide_window = TRUE
    ),
    error = function(cnd) silent
  ))
  keep_turn()
  if (isTRUE(run$timeout)) silent else run[c("status", "stdout")]
}
