#' Run a program that is only asked something
#'
#' R's generator stays as it was: processx draws the names of processes from it.
#' @param arguments A character vector.
#' @param timeout After how many seconds it is ended.
#' @return A list: `status`, `NA` for what could not be run or did not end in time, and `stdout`,
#'   a string, then empty.
#' @noRd
run_quietly <- function(command, arguments, timeout = 30, env = NULL) {
  silent <- list(status = NA_integer_, stdout = "")
  run <- keep_random_state(tryCatch(
    processx::run(
      command, arguments,
      timeout = timeout, env = env, error_on_status = FALSE, cleanup_tree = TRUE,
      windows_hide_window = TRUE
    ),
    error = function(cnd) silent
  ))
  if (isTRUE(run$timeout)) silent else run[c("status", "stdout")]
}
