# Functions that write actions and check batches. They are prepared once, called in every step, and
# handle the usual values. All other values go to check_value(), which finds what is wrong.

is_float <- function(space) startsWith(space$dtype %||% "", "float")

#' Make the function that checks an action, or a batch of actions, and writes its numbers
#'
#' @param space The space of one action.
#' @param n The number of actions, `NULL` for one action.
#' @return A function of an action or a batch. It returns a raw vector, or `NULL` for a value that
#'   [check_value()] or [check_batch()] must handle.
#' @noRd
array_writer <- function(space, n) UseMethod("array_writer")

#' @exportS3Method
array_writer.default <- function(space, n) function(values) NULL

#' @exportS3Method
array_writer.gym_space_discrete <- function(space, n) {
  are_integers <- within_integer(unlist(space_bounds(space)))
  if (are_integers && !is.null(n)) {
    function(values) {
      integers <- if (length(values) == n && is.null(dim(values))) small_integers(values)
      if (!is.null(integers)) integer_bytes(integers)
    }
  } else if (are_integers && space$n <= most_prepared) {
    discrete_writer(space)
  } else {
    array_writer.default(space, n)
  }
}

#' @exportS3Method
array_writer.gym_space_box <- function(space, n) {
  limit <- float_limits[space$dtype]
  if (length(space$shape) != 1L || is.na(limit)) {
    return(array_writer.default(space, n))
  }
  write <- tensor_types[[tensor_dtypes[[space$dtype]]]]$write
  size <- prod(n, space$shape)
  plain <- if (!is.null(n)) list(dim = c(as.integer(n), space$shape))
  function(values) {
    if (length(values) == size && is.double(values) && identical(attributes(values), plain) &&
          isTRUE(max(abs(values)) <= limit)) {
      write(if (is.null(n)) values else as.vector(t(values)))
    }
  }
}

# The largest float32. Larger numbers are refused.
float_limits <- c(float32 = 3.4028234e38, float64 = .Machine$double.xmax)

# If there are at most this many actions, the bytes of each are prepared.
most_prepared <- 1024

discrete_writer <- function(space) {
  values <- as.integer(space$start + (seq_len(space$n) - 1L))
  bytes <- lapply(values, integer_bytes)
  before <- space$start - 1
  n <- length(bytes)
  function(value) {
    if (length(value) == 1L && (is.numeric(value) || is.logical(value)) && !is.object(value)) {
      at <- value - before
      if (!is.na(at) && at == trunc(at) && at >= 1 && at <= n) bytes[[at]]
    }
  }
}

integer_bytes <- function(integers) writeBin(integers, raw(), endian = "little")

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

# If all bounds are the same, comparing with one number is much faster.
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
