# The file of a checkpoint. It is read and written completely or not at all.

# The version of the file's format. Files with another version are refused.
checkpoint_format <- 9L

#' Read the file of a training
#' @return The value written by [training_checkpoint()], `NULL` if there is no file.
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
    abort_checkpoint(path, "was not made by a training or a search", call = call)
  }
  if (!identical(file$format, checkpoint_format)) {
    which <- if (isTRUE(file$format < checkpoint_format)) "an older" else "another"
    problem <- paste0("was written by ", which, " version of this package (", file$version,
                      ", format ", file$format, "), which this version cannot read")
    abort_checkpoint(path, problem, call = call)
  }
  if (!is.raw(file$state) || !identical(rlang::hash(file$state), file$hash)) {
    abort_checkpoint(path, "is damaged", "Its content does not match its hash.", call)
  }
  saved <- unserialize(file$state)
  # Earlier versions wrote a memory to separate files.
  if (!is.null(saved$training$agent$memory$room)) {
    abort_checkpoint(path, "keeps its memory in other files, which this version cannot read",
                     call = call)
  }
  saved
}

write_checkpoint <- function(path, state) {
  # The machine's own byte order takes half the time.
  state <- serialize(state, NULL, xdr = FALSE)
  file <- structure(
    list(
      format = checkpoint_format, version = as.character(utils::packageVersion("gym")),
      hash = rlang::hash(state), state = state
    ),
    class = "gym_checkpoint"
  )
  replace_content(path, serialize(file, NULL, xdr = FALSE))
}

#' Replace the content of a file, completely or not at all
#'
#' The new file is written beside the old one and then renamed.
#' @param bytes A raw vector.
#' @noRd
replace_content <- function(path, bytes) {
  # The name is unique to this process, because another one may write the same file.
  part <- tempfile(paste0(basename(path), "-", Sys.getpid(), "-"), dirname(path), ".part")
  on.exit(unlink(part))
  write_bytes(part, bytes, "wb")
  replace_file(part, path)
}

# Writes bytes to a file, or appends them: `mode` is "wb" or "ab".
write_bytes <- function(path, bytes, mode) {
  before <- if (mode == "ab" && file.exists(path)) file.size(path) else 0
  # Create the connection before opening it: one that cannot be opened would stay open in R.
  connection <- file(path, raw = TRUE)
  tryCatch(
    {
      open(connection, mode)
      writeBin(bytes, connection)
    },
    # The warning says more than the error that follows it.
    warning = function(cnd) stop(conditionMessage(cnd), call. = FALSE),
    finally = suppressWarnings(close(connection))
  )
  # Closing a file does not always fail if the disk is full.
  if (!identical(file.size(path), before + length(bytes))) {
    stop("not all of it could be written", call. = FALSE)
  }
}

# On Windows a file cannot be replaced while another program, such as a virus scanner, reads it.
replace_file <- function(from, to) {
  for (attempt in 1:20) {
    if (suppressWarnings(file.rename(from, to))) {
      return(invisible())
    }
    Sys.sleep(0.05)
  }
  stop("\"", from, "\" cannot be renamed")
}

# Writing again and again --------------------------------------------------------------

# After each write, wait for nine times as long as it took: writing then takes at most a tenth of
# the time.
rest_per_writing <- 9

#' Prepare to write a file from time to time
#' @param checkpoint As returned by [open_checkpoint()]. If there is no file yet, it is written now.
#' @param state A function that returns the value to write.
#' @param what What is kept, `"search"` or `"training"`.
#' @return A function that writes the file if it is the `last` time or the waiting time is over.
#' @noRd
checkpoint_writer <- function(checkpoint, state, what, call) {
  path <- checkpoint$path
  if (is.null(checkpoint$saved)) {
    tryCatch(
      write_checkpoint(path, state()),
      error = function(cnd) {
        abort_checkpoint(path, "cannot be written", conditionMessage(cnd), call)
      }
    )
  }
  rest_until <- -Inf
  failed <- FALSE
  overtaken <- FALSE
  written <- if (is.null(checkpoint$saved)) file_mark(path) else checkpoint$mark
  write <- function() {
    own <- state()
    if (!identical(file_mark(path), written)) {
      whose <- overtaken_by(path, own, what)
      if (!is.null(whose)) {
        if (!overtaken) {
          warn_checkpoint(path, paste0(whose, ", and is left as it is"),
                          i = "Give each of them its own `checkpoint` file.")
        }
        overtaken <<- TRUE
        return()
      }
    }
    write_checkpoint(path, own)
    written <<- file_mark(path)
  }
  function(last = FALSE) {
    began <- now()
    if (!last && began < rest_until) {
      return(invisible())
    }
    tryCatch(
      write(),
      error = function(cnd) {
        # Do not stop a long training because the disk is full.
        if (!failed) {
          warn_checkpoint(path, paste("cannot be written; the", what, "continues without it"),
                          x = conditionMessage(cnd))
        }
        failed <<- TRUE
      }
    )
    ended <- now()
    rest_until <<- ended + rest_per_writing * (ended - began)
  }
}

# These values change when another process replaces a file.
file_mark <- function(path) as.list(file.info(path)[c("size", "mtime", "ctime")])

# Checks whether another process has written a file that must be kept. Returns a text that says
# whose file it is, or NULL if our version may replace it.
overtaken_by <- function(path, own, what) {
  there <- tryCatch(read_checkpoint(path, NULL), error = function(cnd) NULL)
  if (is.null(there)) {
    NULL
  } else if (!is_same(there$what, own$what) || !is_same(there$arguments, own$arguments)) {
    paste("now belongs to another", what)
  } else if (there$training$steps > own$training$steps) {
    paste("belongs to the same", what, "in another process, which is ahead")
  }
}

warn_checkpoint <- function(path, problem, ...) {
  rlang::warn(
    c(paste0("The checkpoint \"", path, "\" ", problem, "."), ...),
    class = "gym_warning_checkpoint"
  )
}
