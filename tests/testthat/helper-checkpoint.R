# The parts of a training that must be equal in two runs: not its time, date and machine.
what_counts <- function(training) {
  training$history$elapsed <- NULL
  training[setdiff(names(training), c("elapsed", "env", "provenance"))]
}

# Lets searches write their checkpoint after each batch, and keeps the file of each write.
local_kept_files <- function(frame = parent.frame()) {
  files <- new.env()
  files$list <- list()
  write <- write_checkpoint
  local_functions(
    write_checkpoint = function(path, state) {
      write(path, state)
      files$list <- c(files$list, list(readBin(path, "raw", file.size(path))))
    },
    rest_per_writing = 0,
    frame = frame
  )
  files
}

local_checkpoint <- function(bytes = NULL, frame = parent.frame()) {
  path <- withr::local_tempfile(fileext = ".rds", .local_envir = frame)
  if (!is.null(bytes)) writeBin(bytes, path)
  path
}
