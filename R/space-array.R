# Spaces whose values are arrays of numbers: Box, MultiDiscrete, MultiBinary. In R their values are
# vectors, or arrays if there is more than one dimension. Discrete also uses the functions for
# single numbers.

#' @exportS3Method
space_label.gym_space_box <- function(space) paste("Box", space$dtype, shape_text(space$shape))

#' @exportS3Method
space_label.gym_space_multidiscrete <- function(space) {
  n <- prod(space$shape)
  if (length(space$shape) != 1L || n > 10L) {
    return(paste("MultiDiscrete of shape", shape_text(space$shape)))
  }
  all_text <- function(bound) shape_text(rep(bound, length.out = n))
  from <- if (any(space$start != 0)) paste(" from", all_text(space$start))
  paste0("MultiDiscrete ", all_text(space$nvec), from)
}

#' @exportS3Method
space_label.gym_space_multibinary <- function(space) paste("MultiBinary", shape_text(space$shape))

# The lower and the upper bound of each number, row by row. This also works for a Discrete space.
space_bounds <- function(space) {
  if (inherits(space, "gym_space_box")) {
    return(list(low = space$low, high = space$high))
  }
  if (inherits(space, "gym_space_multibinary")) {
    n <- prod(space$shape)
    return(list(low = rep(0, n), high = rep(1, n)))
  }
  start <- as.double(space$start)
  list(low = start, high = start + (as.double(space$nvec %||% space$n) - 1))
}

# Reading ---------------------------------------------------------------------------

#' @exportS3Method
decode_value.gym_space_array <- function(space, json) {
  values <- check_numbers(decode_numbers(space$dtype, json), space$shape)
  shape_values(values, space$shape)
}

# Converts nested numbers to one vector, of the R type for the dtype.
decode_numbers <- function(dtype, json) {
  switch(dtype,
    float16 = ,
    float32 = ,
    float64 = as.numeric(numbers_from_json(json)),
    bool = as.logical(unlist(json, use.names = FALSE)),
    whole_from_json(json)
  )
}

# Checking --------------------------------------------------------------------------

#' @exportS3Method
check_value.gym_space_array <- function(space, value, path, call, bounds = FALSE) {
  refuse <- function(problem, path) abort_space(space, value, problem, call, path)
  takes_logical <- space$dtype == "bool" || space$name %in% c("MultiBinary", "MultiDiscrete")
  numeric <- is.numeric(value) && !is_integer64(value)
  if (!numeric && !(is.logical(value) && takes_logical)) {
    refuse(paste("A value of a", space$name, "is numeric"), path)
  }
  if (!identical(value_shape(value, space), space$shape)) {
    refuse(paste("The value must be", wanted_shape(space$shape)), path)
  }
  flat <- row_major(value)
  wrong <- wrong_number(space, flat) %||% if (bounds) out_of_bounds(space, flat)
  if (!is.null(wrong)) refuse(wrong$problem, path_index(path, unravel(wrong$at, space$shape)))
}

wanted_shape <- function(shape) {
  if (length(shape) <= 1L) {
    paste("of length", prod(shape))
  } else {
    paste("an array with dim", paste(shape, collapse = " x "))
  }
}

# The shape of an R value. A vector without dim has one dimension, with two exceptions. If values of
# the space have no dimensions, a single number has none either. If a batch has one number for each
# sub-environment, a vector counts as a matrix of one column.
value_shape <- function(value, space) {
  if (!is.null(dim(value))) {
    dim(value)
  } else if (isTRUE(space$column)) {
    c(length(value), 1L)
  } else if (length(value) == 1L && length(space$shape) == 0L) {
    integer()
  } else {
    length(value)
  }
}

# Finds the first number that does not belong to the space: a missing one, or one with a fraction if
# numbers must be whole. Returns NULL if all are right. NaN is not missing; only a check of the
# bounds refuses it.
wrong_number <- function(space, flat) {
  missing <- if (anyNA(flat)) is.na(flat) & !is.nan(flat)
  if (any(missing)) {
    return(list(problem = "There is a missing value", at = which(missing)[[1L]]))
  }
  if (is.double(flat) && space$dtype %in% integer_dtypes) {
    broken <- !is.finite(flat) | flat != trunc(flat)
    if (any(broken)) {
      return(list(problem = "There is a number that is not whole", at = which(broken)[[1L]]))
    }
  }
}

out_of_bounds <- function(space, flat) {
  given <- as.double(flat)
  flat <- round_to_dtype(given, space$dtype)
  allowed <- allowed_bounds(space)
  outside <- !(flat >= allowed$low & flat <= allowed$high)
  outside <- is.na(outside) | outside
  if (any(outside)) {
    at <- which(outside)[[1L]]
    bounds <- lapply(space_bounds(space), function(bound) as.double(rep_len(bound, at)[[at]]))
    text <- lapply(c(given[[at]], bounds), format, digits = 15L)
    outside <- paste("outside of the bounds", text[[2L]], "and", text[[3L]])
    list(problem = paste0("There is a number ", outside, ": ", text[[1L]]), at = at,
         outside = outside)
  }
}

#' Allow the numbers of a space to exceed their bounds by a rounding error
#'
#' Observations are computed, often from numbers of another dtype: float32 has only seven digits.
#' [space_contains()] does not use this, so that it agrees with Gymnasium.
#' @noRd
allow_rounding <- function(space) {
  if (inherits(space, "gym_space_box") && !space$dtype %in% c(integer_dtypes, "bool")) {
    space$tolerance <- 1e-6
  }
  inside <- intersect(c("space", "node_space", "edge_space"), names(space))
  space[inside] <- lapply(space[inside], allow_rounding)
  if (!is.null(space$spaces)) space$spaces <- lapply(space$spaces, allow_rounding)
  space
}

allowed_bounds <- function(space) {
  bounds <- space_bounds(space)
  if (!is.null(space$tolerance)) {
    rounding <- lapply(bounds, function(bound) {
      ifelse(is.finite(bound), space$tolerance * pmax(1, abs(bound)), 0)
    })
    bounds <- list(low = bounds$low - rounding$low, high = bounds$high + rounding$high)
  }
  bounds
}

# Converts the number of an element, from 1 and row by row, to its indices, from 0.
unravel <- function(at, shape) {
  if (length(shape) == 0L) integer() else rev(arrayInd(at, rev(shape))) - 1L
}

# Rounds doubles like a conversion to a smaller dtype.
round_to_dtype <- function(x, dtype) {
  switch(dtype,
    float32 = readBin(writeBin(as.double(x), raw(), size = 4L), "double", length(x), size = 4L),
    float16 = double_from_half(half_from_double(x)),
    x
  )
}

# Writing ---------------------------------------------------------------------------

#' @exportS3Method
write_value.gym_space_array <- function(space, value) {
  flat <- row_major(value)
  whole <- space$dtype %in% integer_dtypes && !is.integer(flat)
  elements <- if (whole) whole_text(flat) else json_number(flat)
  if (length(space$shape) == 0L) elements else json_nested(elements, space$shape)
}

# Drawing ---------------------------------------------------------------------------

#' @exportS3Method
space_sample.gym_space_array <- function(space) {
  bounds <- space_bounds(space)
  shape_values(draw_numbers(space$dtype, bounds$low, bounds$high), space$shape)
}

draw_numbers <- function(dtype, low, high) {
  if (dtype == "bool") {
    stats::runif(length(low)) < (low + high) / 2
  } else if (dtype %in% integer_dtypes) {
    draw_whole(low, high)
  } else {
    round_to_dtype(draw_between(low, high), dtype)
  }
}

draw_whole <- function(low, high) {
  # For int64, draw only numbers that R can represent exactly.
  low <- pmax(low, pmin(1 - 2^53, high))
  high <- pmin(high, pmax(2^53 - 1, low))
  width <- high - low
  narrow <- width < 2^53
  numbers <- floor(draw_between(low, high + narrow))
  numbers <- pmin(pmax(numbers, low), high)
  check_exact(numbers)
  narrow_whole(numbers)
}

draw_between <- function(low, high) {
  n <- length(low)
  values <- numeric(n)
  below <- is.finite(low)
  above <- is.finite(high)
  both <- below & above
  share <- stats::runif(sum(both))
  # Two products, because high - low may overflow.
  values[both] <- low[both] * (1 - share) + high[both] * share
  values[below & !above] <- low[below & !above] + stats::rexp(sum(below & !above))
  values[above & !below] <- high[above & !below] - stats::rexp(sum(above & !below))
  values[!below & !above] <- stats::rnorm(sum(!below & !above))
  pmin(pmax(values, low), high)
}

# Discrete: one of n consecutive whole numbers -----------------------------------------------

#' @exportS3Method
space_label.gym_space_discrete <- function(space) {
  from <- if (space$start != 0) paste(" from", whole_text(space$start))
  paste0("Discrete ", whole_text(space$n), from)
}

#' @exportS3Method
decode_value.gym_space_discrete <- function(space, json) {
  value <- whole_from_json(json)
  if (!is_whole(value)) {
    abort_answer(paste("A value of Discrete is", describe_value(value)))
  }
  value
}

#' @exportS3Method
check_value.gym_space_discrete <- function(space, value, path, call, bounds = FALSE) {
  if (is.logical(value)) {
    # TRUE is 1 in R, as True is in Python.
    value <- as.integer(value)
  }
  if (!is_whole(value)) {
    abort_space(space, value, "A value of Discrete is one whole number", call, path)
  }
  wrong <- if (bounds) out_of_bounds(space, value)
  if (!is.null(wrong)) {
    abort_space(space, value, paste("The number is", wrong$outside), call, path)
  }
}

# Nearly every step calls this, so it must be fast.
is_whole <- function(value) {
  length(value) == 1L && is.numeric(value) && !is.object(value) && is.finite(value) &&
    value == trunc(value)
}

#' @exportS3Method
write_value.gym_space_discrete <- function(space, value) sprintf("%.0f", value)

#' @exportS3Method
space_sample.gym_space_discrete <- function(space) {
  if (is.integer(space$n) && is.integer(space$start)) {
    space$start + sample.int(space$n, 1L) - 1L
  } else {
    bounds <- space_bounds(space)
    draw_whole(bounds$low, bounds$high)
  }
}
