# Runs scripts side by side. Each runs in its own R process and writes its result to a file.

#' @param script The script, which gets the arguments of a task and the name of the file.
#' @param tasks A list of the tasks' arguments, character vectors.
#' @param finish A function of the file's content and of the task's arguments, which is called when
#'   the task has ended.
run_side_by_side <- function(script, tasks, processes, finish) {
  start <- function(task) {
    file <- tempfile(fileext = ".rds")
    process <- processx::process$new(
      file.path(R.home("bin"), "Rscript"), c("--no-init-file", script, task, file),
      stderr = paste0(file, ".txt"), cleanup_tree = TRUE
    )
    list(process = process, file = file, task = task)
  }
  end <- function(one) {
    if (file.exists(one$file)) {
      finish(readRDS(one$file), one$task)
    } else {
      # The other tasks go on. This one runs again when the script runs again.
      cat(one$task, "failed:", readLines(paste0(one$file, ".txt")), sep = "\n")
    }
  }
  running <- list()
  while (length(tasks) || length(running)) {
    while (length(tasks) && length(running) < processes) {
      running <- c(running, list(start(tasks[[1L]])))
      tasks <- tasks[-1L]
    }
    Sys.sleep(0.5)
    ended <- !vapply(running, function(one) one$process$is_alive(), NA)
    for (one in running[ended]) end(one)
    running <- running[!ended]
  }
}

# The value of an argument NAME=VALUE of the script.
option <- function(name, default) {
  given <- strsplit(commandArgs(trailingOnly = TRUE), "=", fixed = TRUE)
  found <- Filter(function(one) one[[1L]] == name, given)
  if (length(found)) found[[1L]][[2L]] else default
}
