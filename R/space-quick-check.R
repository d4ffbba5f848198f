# Fast checks of batches in every step. Usually all values fit, and then the place of a misfit is
# not needed.

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
