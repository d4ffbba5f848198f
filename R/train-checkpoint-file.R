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
  unserialize(file$state)
}

write_checkpoint <- function(path, state) {
  state <- serialize(state, NULL)
  file <- structure(
    list(
      format = checkpoint_format, version = as.character(utils::packageVersion("gym")),
      hash = rlang::hash(state), state = state
    ),
    class = "gym_checkpoint"
  )
  replace_content(path, serialize(file, NULL))
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

# Whether another process has written the file meanwhile and its version must be kept. Returns a
# description of the owner, or NULL if our version may replace it.
overtaken_by <- function(path, own, what) {
  there <- tryCatch(read_checkpoint(path, NULL), error = function(cnd) NULL)
  if (is.null(there)) {
    NULL
  } else if (!is_same(there$what, own$what) || !is_same(there$arguments, own$arguments)) {
    paste("is now that of another", what)
  } else if (there$training$steps > own$training$steps) {
    paste("is that of the same", what, "in another process, which is ahead")
  }
}

warn_checkpoint <- function(path, problem, ...) {
  rlang::warn(
    c(paste0("The checkpoint \"", path, "\" ", problem, "."), ...),
    class = "gym_warning_checkpoint"
  )
}

# The memory of an agent -----------------------------------------------------------------

# The memory of an agent: the steps that it learns from repeatedly. It is large and grows slowly, so
# a checkpoint does not rewrite it: new steps are appended to files beside it.

#' Make an empty memory
#' @param size The largest number of steps; the oldest are overwritten.
#' @return A list of class `gym_memory`: `size`, `count`, the total number of steps so far, and
#'   `steps`, a matrix with the numbers of a step in each column.
#' @noRd
new_memory <- function(size) {
  structure(list(size = size, count = 0, steps = NULL), class = "gym_memory")
}

#' Add steps to a memory
#' @param new A matrix with a step in each column.
#' @noRd
add_to_memory <- function(memory, new) {
  n <- ncol(new)
  # If there are more than fit, only the last ones.
  kept <- seq.int(max(1, n - memory$size + 1), n)
  at <- memory_columns(memory, memory$count + kept)
  room <- max(0L, ncol(memory$steps))
  if (max(at) > room) {
    grown <- matrix(0, nrow(new), min(memory$size, max(2 * room, at, 1024)))
    if (room) grown[, seq_len(room)] <- memory$steps
    memory$steps <- grown
  }
  memory$steps[, at] <- new[, kept]
  memory$count <- memory$count + n
  memory
}

# The columns of the steps with these numbers, from 1.
memory_columns <- function(memory, number) (number - 1) %% memory$size + 1

# In files ---------------------------------------------------------------------------------------

# A file has as many steps as the memory; later ones go into the next file. So two files contain the
# whole memory, and older ones are removed. Each process has its own files, with its key in their
# names, and the checkpoint has the key: processes that share a checkpoint do not touch each other's
# files.
memory_file <- function(path, key, number) paste0(path, ".memory-", key, "-", number)

memory_files <- function(path, key = "[0-9a-f]+") {
  files <- list.files(dirname(path), "[.]memory-[0-9a-f]+-[0-9]+$", full.names = TRUE)
  own <- startsWith(basename(files), paste0(basename(path), ".memory-"))
  files[own & grepl(paste0("[.]memory-", key, "-[0-9]+$"), files)]
}

#' Prepare to keep a memory in files
#' @param path The checkpoint.
#' @param earlier The key of the checkpoint that training resumes from, `NULL` for none.
#' @return A function of an agent, which appends new steps and returns the agent with an empty
#'   memory, as the checkpoint keeps it.
#' @noRd
memory_writer <- function(path, earlier = NULL) {
  # A process that still runs has written to its own files recently.
  files <- setdiff(memory_files(path), if (!is.null(earlier)) memory_files(path, earlier))
  unlink(files[difftime(Sys.time(), file.mtime(files), units = "mins") > 10])
  # A name that no other process has, drawn without R's generator.
  key <- sub("^memory", "", basename(tempfile("memory")))
  count <- 0
  function(agent) {
    memory <- agent$memory
    if (!inherits(memory, "gym_memory") || is.null(memory$steps)) {
      return(agent)
    }
    if (!is.null(earlier)) {
      saved <- tryCatch(read_checkpoint(path, NULL), error = function(cnd) NULL)
      if (identical(saved$training$agent$memory$key, key)) {
        unlink(memory_files(path, earlier))
        earlier <<- NULL
      }
    }
    # The last two files stay, in case a checkpoint could not be written.
    files <- memory_files(path, key)
    after <- as.numeric(sub(".*-", "", files)) + 1
    unlink(files[after * memory$size <= count - 2 * memory$size])
    first <- max(0, memory$count - memory$size) %/% memory$size
    if (count == 0 || !file.exists(memory_file(path, key, (count - 1) %/% memory$size))) {
      # Write the whole memory, even if somebody has removed the files.
      count <<- first * memory$size
    }
    while (count < memory$count) {
      number <- count %/% memory$size
      end <- min(memory$count, (number + 1) * memory$size)
      append_memory(memory, memory_file(path, key, number), count + 1, end)
      count <<- end
    }
    agent$memory$key <- key
    agent$memory$room <- ncol(memory$steps)
    agent$memory$width <- nrow(memory$steps)
    agent$memory["steps"] <- list(NULL)
    agent
  }
}

# Forgotten steps are not needed any more: zeros keep their place.
append_memory <- function(memory, file, first, last) {
  numbers <- seq.int(first, last)
  # Cut off what an earlier attempt on a full disk has left.
  before <- 8 * nrow(memory$steps) * ((first - 1) %% memory$size)
  if (file.exists(file) && file.size(file) != before) {
    replace_content(file, readBin(file, "raw", before))
  }
  values <- memory$steps[, memory_columns(memory, numbers), drop = FALSE]
  values[, numbers <= memory$count - memory$size] <- 0
  write_bytes(file, writeBin(as.vector(values), raw(), endian = "little"), "ab")
}

#' Read the memory of an agent from its files
#' @param agent As memory_writer() left it in the checkpoint.
#' @noRd
restore_memory <- function(agent, path, call = NULL) {
  memory <- agent$memory
  if (!inherits(memory, "gym_memory") || is.null(memory$room)) {
    return(agent)
  }
  steps <- matrix(0, memory$width, memory$room)
  first <- max(0, memory$count - memory$size)
  while (first < memory$count) {
    number <- first %/% memory$size
    end <- min(memory$count, (number + 1) * memory$size)
    file <- memory_file(path, memory$key, number)
    # Steps behind these were written after the checkpoint.
    count <- (end - number * memory$size) * memory$width
    if (!file.exists(file) || file.size(file) < 8 * count) {
      gym_abort(
        c(paste0("The memory that belongs to the checkpoint, \"", file,
                 "\", is missing or damaged."),
          i = "`resume = FALSE` starts again."),
        class = c("gym_error_checkpoint", "gym_error_argument"), path = file, call = call
      )
    }
    values <- matrix(readBin(file, "double", count, endian = "little"), memory$width)
    numbers <- seq.int(first + 1, end)
    steps[, memory_columns(memory, numbers)] <- values[, numbers - number * memory$size]
    first <- end
  }
  memory$steps <- steps
  agent$memory <- memory[names(new_memory(1))]
  class(agent$memory) <- "gym_memory"
  agent
}
