# What counts of a training, without how long it took, when and where.
what_counts <- function(training) {
  training$history$elapsed <- NULL
  training[setdiff(names(training), c("elapsed", "env", "provenance"))]
}

# Plays a search that writes after each batch, and keeps the file as each write left it.
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
