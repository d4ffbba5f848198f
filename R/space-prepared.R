# Functions that read, write and check a space's values, prepared once and called in every step.
# They handle the usual values; anything else takes the general way, which finds what is wrong.

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
    for (i in seq_along(readers)) json[[i]] <- readers[[i]](json[[i]]) %||% return(NULL)
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

# Checks of batches ------------------------------------------------------------------------

#' Make a fast check of batches of values of a space
#'
#' @return A function of a batch and of the number of values that it must have, an integer of at
#'   least 1. It returns `TRUE` if all of them certainly belong to the space, including bounds.
#'   After `FALSE`, [check_batch()] decides.
#' @noRd
quick_check <- function(space) UseMethod("quick_check")

#' @exportS3Method
quick_check.default <- function(space) function(values, n) FALSE

#' @exportS3Method
quick_check.gym_space_discrete <- function(space) {
  bounds <- space_bounds(space)
  low <- bounds$low
  high <- bounds$high
  function(values, n) {
    length(values) == n && is.null(dim(values)) && is_plain(values) &&
      is_between(values, low, high) && is_all_whole(values)
  }
}

#' @exportS3Method
quick_check.gym_space_array <- function(space) {
  shape <- space$shape
  is_within <- quick_bounds(space)
  takes_logical <- space$dtype == "bool" || space$name %in% c("MultiBinary", "MultiDiscrete")
  must_be_whole <- space$dtype %in% integer_dtypes
  function(values, n) {
    is_plain(values, takes_logical) && has_batch_shape(values, n, shape) &&
      is_within(values, n) && (!must_be_whole || is_all_whole(values))
  }
}

#' @exportS3Method
quick_check.gym_space_tuple <- function(space) {
  checks <- lapply(unname(space$spaces), quick_check)
  keys <- names(space$spaces)
  function(values, n) {
    if (!is.list(values) || length(values) != length(checks) || !identical(names(values), keys)) {
      return(FALSE)
    }
    for (i in seq_along(checks)) {
      if (!checks[[i]](values[[i]], n)) {
        return(FALSE)
      }
    }
    TRUE
  }
}

#' @exportS3Method
quick_check.gym_space_dict <- quick_check.gym_space_tuple

# Numbers without a class, at least one, without missing values.
is_plain <- function(x, takes_logical = TRUE) {
  (is.numeric(x) || takes_logical && is.logical(x)) && length(x) > 0L && !is.object(x) && !anyNA(x)
}

is_between <- function(x, low, high) min(x) >= low && max(x) <= high

is_all_whole <- function(x) !is.double(x) || all(x == trunc(x))

has_batch_shape <- function(values, n, shape) {
  if (length(shape) == 0L || is.null(dim(values))) {
    is.null(dim(values)) && length(values) == n && prod(shape) == 1
  } else {
    identical(dim(values), c(n, shape))
  }
}

# Comparing with one number for all, if possible, is much faster.
quick_bounds <- function(space) {
  each <- prod(space$shape)
  bounds <- lapply(allowed_bounds(space), function(bound) {
    as.vector(shape_values(rep(as.double(bound), length.out = each), space$shape))
  })
  low <- bounds$low
  high <- bounds$high
  if (all(low == low[1L]) && all(high == high[1L])) {
    low <- low[1L]
    high <- high[1L]
    return(function(values, n) is_between(values, low, high))
  }
  spread <- 1L
  lows <- low
  highs <- high
  function(values, n) {
    if (n != spread) {
      lows <<- rep(low, each = n)
      highs <<- rep(high, each = n)
      spread <<- n
    }
    all(values >= lows & values <= highs)
  }
}
