# Functions that read and write a space's values, prepared once and called in every step. They
# handle the usual values; anything else takes the general way, which finds what is wrong with it.

#' Make the function that reads a space's values from JSON
#' @return A function of the parsed value, which returns `NULL` for a value that [decode_value()]
#'   must handle.
#' @noRd
json_reader <- function(space) UseMethod("json_reader")

#' @exportS3Method
json_reader.default <- function(space) function(json) NULL

#' @exportS3Method
json_reader.gym_space_array <- function(space) {
  n <- prod(space$shape)
  if (length(space$shape) > 1L || !is_float(space)) {
    return(json_reader.default(space))
  }
  function(json) {
    values <- unlist(json, use.names = FALSE)
    if (is.double(values) && length(values) == n && !anyNA(values)) values
  }
}

is_float <- function(space) startsWith(space$dtype %||% "", "float")

#' @exportS3Method
json_reader.gym_space_discrete <- function(space) {
  function(json) if (is.integer(json) && length(json) == 1L) json
}

#' @exportS3Method
json_reader.gym_space_tuple <- function(space) {
  readers <- lapply(unname(space$spaces), json_reader)
  keys <- names(space$spaces)
  function(json) {
    if (!is.list(json) || length(json) != length(readers) || !identical(names(json), keys)) {
      return(NULL)
    }
    for (i in seq_along(readers)) {
      json[[i]] <- readers[[i]](json[[i]]) %||% return(NULL)
    }
    json
  }
}

#' @exportS3Method
json_reader.gym_space_dict <- json_reader.gym_space_tuple

#' @exportS3Method
json_reader.gym_space_texts <- function(space) json_reader.default(space)

# Writers ----------------------------------------------------------------------------------

#' Make the function that checks an action and writes it as a member of a JSON object
#' @return A function of an action, which returns `NULL` for one that [check_value()] must handle.
#' @noRd
json_writer <- function(space) UseMethod("json_writer")

#' @exportS3Method
json_writer.default <- function(space) function(value) NULL

#' @exportS3Method
json_writer.gym_space_discrete <- function(space) {
  function(value) {
    if (length(value) == 1L && (is.numeric(value) || is.logical(value)) && !is.object(value) &&
          is.finite(value) && value == trunc(value)) {
      sprintf('"action":%.0f,', as.double(value))
    }
  }
}

#' @exportS3Method
json_writer.gym_space_box <- function(space) {
  n <- prod(space$shape)
  if (length(space$shape) != 1L || !is_float(space)) {
    return(json_writer.default(space))
  }
  function(value) {
    if (length(value) == n && is.double(value) && is.null(attributes(value)) &&
          all(is.finite(value))) {
      paste0('"action":', json_array(json_number(value)), ",")
    }
  }
}

#' Make the function that checks an action, or a batch of actions, and writes its numbers
#'
#' @param space The space of one action.
#' @param n The number of actions, `NULL` for one action.
#' @return A function of an action or a batch, which returns a raw vector, or `NULL` for one that
#'   [check_value()] or [check_batch()] must handle.
#' @noRd
array_writer <- function(space, n) {
  if (!is.null(n)) {
    write <- tensors_writer(space, n)
    write_integers <- int64_writer(n)
    return(function(values) {
      tensors <- write(values)
      if (is.integer(tensors)) write_integers(tensors) else tensors$action$bytes
    })
  }
  if (inherits(space, "gym_space_discrete") && space$n <= most_prepared &&
        within_integer(unlist(space_bounds(space)))) {
    return(discrete_writer(space))
  }
  limit <- if (inherits(space, "gym_space_box") && length(space$shape) == 1L) {
    float_limits[space$dtype]
  } else {
    NA
  }
  if (is.na(limit)) {
    return(function(value) NULL)
  }
  write <- tensor_types[[tensor_dtypes[[space$dtype]]]]$write
  function(value) {
    if (length(value) == space$shape && is.double(value) && is.null(attributes(value)) &&
          isTRUE(max(abs(value)) <= limit)) {
      write(value)
    }
  }
}

# The bytes of so many actions are prepared.
most_prepared <- 1024

discrete_writer <- function(space) {
  values <- as.integer(space$start + (seq_len(space$n) - 1L))
  bytes <- lapply(values, int64_writer(1L))
  before <- space$start - 1
  n <- length(bytes)
  function(value) {
    if (length(value) == 1L && (is.numeric(value) || is.logical(value)) && !is.object(value)) {
      at <- value - before
      if (!is.na(at) && at == trunc(at) && at >= 1 && at <= n) bytes[[at]]
    }
  }
}

# Makes the function that writes `n` integers as int64. Each has two halves, and the second one is
# zero except for negative numbers.
int64_writer <- function(n) {
  zeros <- integer(2L * n)
  first <- seq.int(1L, by = 2L, length.out = n)
  function(integers) {
    halves <- zeros
    halves[first] <- integers
    if (min(integers) < 0L) halves[first + 1L] <- -(integers < 0L)
    writeBin(halves, raw(), endian = "little")
  }
}

#' Make the function that checks a batch of actions and puts it into tensors
#'
#' @param space The space of one action.
#' @param n The number of actions.
#' @return A function of a batch. It returns `NULL` for one that [check_batch()] must handle,
#'   integers unchanged, and otherwise a list of tensors.
#' @noRd
tensors_writer <- function(space, n) UseMethod("tensors_writer")

#' @exportS3Method
tensors_writer.default <- function(space, n) function(values) NULL

#' @exportS3Method
tensors_writer.gym_space_discrete <- function(space, n) {
  if (space$dtype == "uint64") {
    return(tensors_writer.default(space, n))
  }
  function(values) if (length(values) == n && is.null(dim(values))) small_integers(values)
}

# The largest float32. Larger numbers are refused.
float_limits <- c(float32 = 3.4028234e38, float64 = .Machine$double.xmax)

#' @exportS3Method
tensors_writer.gym_space_box <- function(space, n) {
  shape <- c(as.integer(n), space$shape)
  limit <- float_limits[space$dtype]
  if (length(shape) != 2L || is.na(limit)) {
    return(tensors_writer.default(space, n))
  }
  type <- tensor_dtypes[[space$dtype]]
  write <- tensor_types[[type]]$write
  function(values) {
    if (is.double(values) && !is.object(values) && identical(dim(values), shape) &&
          is.null(dimnames(values)) &&
          isTRUE(max(abs(values)) <= limit)) {
      numbers <- if (shape[[2L]] == 1L) values else t(values)
      list(action = list(dtype = type, shape = shape, bytes = write(as.vector(numbers))))
    }
  }
}
