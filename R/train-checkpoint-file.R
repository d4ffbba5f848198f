# The file of a search's checkpoint: read whole or not at all, written whole or not at all.

# Of the file's form. Files of another are refused.
checkpoint_format <- 1L

#' Read the file of a search
#' @return What [keep_search()] wrote, `NULL` where there is no file.
#' @noRd
read_checkpoint <- function(path, call) {
  if (!file.exists(path)) {
    return(NULL)
  }
  file <- tryCatch(
    suppressWarnings(readRDS(path)),
    error = function(cnd) abort_checkpoint(path, "cannot be read", conditionMessage(cnd), call)
  )
  if (!inherits(file, "gym_checkpoint")) {
    abort_checkpoint(path, "is none of a search", call = call)
  }
  if (!identical(file$format, checkpoint_format)) {
    abort_checkpoint(
      path, paste("was written by another version of this package,", file$version), call = call
    )
  }
  if (!is.raw(file$state) || !identical(rlang::hash(file$state), file$hash)) {
    abort_checkpoint(path, "is damaged", "Its content is not what was written.", call)
  }
  unserialize(file$state)
}

# What a kill in the middle of writing has left. A young one may be another process's.
remove_parts <- function(path) {
  files <- list.files(dirname(path), "[.]part$", full.names = TRUE)
  parts <- files[startsWith(basename(files), paste0(basename(path), "-"))]
  unlink(parts[difftime(Sys.time(), file.mtime(parts), units = "mins") > 10])
}

#' Write the file of a search
#'
#' Beside the one that is there, which it then replaces in one move.
#' @noRd
write_checkpoint <- function(path, state) {
  state <- serialize(state, NULL)
  file <- structure(
    list(
      format = checkpoint_format, version = as.character(utils::packageVersion("gym")),
      hash = rlang::hash(state), state = state
    ),
    class = "gym_checkpoint"
  )
  # A name of its own: another process may have been given the same checkpoint.
  part <- tempfile(paste0(basename(path), "-", Sys.getpid(), "-"), dirname(path), ".part")
  on.exit(unlink(part))
  bytes <- serialize(file, NULL)
  # The warning knows more than the error.
  tryCatch(writeBin(bytes, part), warning = function(cnd) stop(conditionMessage(cnd)))
  # A disk that is full is not always told when a file is closed.
  if (!identical(file.size(part), as.numeric(length(bytes)))) {
    stop("not all of it could be written")
  }
  replace_file(part, path)
}

# On Windows a file that somebody reads, such as a virus scanner, cannot be replaced just then.
replace_file <- function(from, to) {
  for (attempt in 1:20) {
    if (suppressWarnings(file.rename(from, to))) {
      return(invisible())
    }
    Sys.sleep(0.05)
  }
  stop("\"", from, "\" cannot be renamed")
}
