# Values of several lanes: numbers in an array with the lane as its first dimension (a
# vector for single numbers), texts in a character vector, Tuple and Dict part by part,
# other values in a list.

has_parts <- function(space) {
  inherits(space, "gym_space_tuple") || inherits(space, "gym_space_dict")
}

# For each part of a Tuple or Dict the same.
map_parts <- function(space, part, ...) {
  parts <- Map(part, unname(space$spaces), ...)
  names(parts) <- names(space$spaces)
  parts
}

#' Put single values, one for each lane, together
#' @param values A list of values of the space.
#' @noRd
lanes_from <- function(space, values) {
  if (is_stackable(space)) {
    stack_values(space, values)
  } else if (inherits(space, "gym_space_text")) {
    as.character(values)
  } else if (has_parts(space)) {
    each <- lapply(seq_along(space$spaces), function(i) lapply(values, function(v) v[[i]]))
    map_parts(space, lanes_from, each)
  } else {
    values
  }
}

#' Take the value of one lane
#' @noRd
lane_value <- function(space, lanes, i) {
  if (has_parts(space)) {
    map_parts(space, lane_value, in_order(space, lanes), i)
  } else if (is_stackable(space)) {
    value <- rows_of(lanes, i)
    dim(value) <- if (length(space$shape) > 1L) dim(value)[-1L]
    value
  } else {
    lanes[[i]]
  }
}

#' Take the values of some lanes
#' @param i Their numbers; one may come more than once.
#' @noRd
lane_rows <- function(space, lanes, i) {
  if (has_parts(space)) {
    map_parts(space, lane_rows, in_order(space, lanes), list(i))
  } else {
    rows_of(lanes, i)
  }
}

rows_of <- function(x, i) {
  shape <- dim(x)
  if (is.null(shape)) {
    x[i]
  } else if (length(shape) == 2L) {
    x[i, , drop = FALSE]
  } else {
    dim(x) <- c(shape[[1L]], prod(shape[-1L]))
    x <- x[i, , drop = FALSE]
    dim(x) <- c(length(i), shape[-1L])
    x
  }
}

# A policy may name the parts of a Dict in any order.
in_order <- function(space, parts) {
  keys <- names(space$spaces)
  if (is.null(keys) || is.null(names(parts))) parts else parts[match(keys, enc2utf8(names(parts)))]
}

#' Put the lanes of several values after each other
#' @param each A list of values of lanes, at least one.
#' @noRd
bind_lanes <- function(space, each) {
  if (has_parts(space)) {
    parts <- lapply(seq_along(space$spaces), function(i) {
      lapply(each, function(lanes) in_order(space, lanes)[[i]])
    })
    map_parts(space, bind_lanes, parts)
  } else if (!is_stackable(space)) {
    do.call(c, each)
  } else if (any(vapply(each, inherits, NA, "integer64"))) {
    # Beside those that arrived as integer or double, as they fitted.
    digits <- unlist(lapply(each, function(lanes) whole_text(row_major(lanes))))
    n <- length(digits) / prod(space$shape)
    shape_values(whole_from_digits(digits), c(n, space$shape))
  } else if (is.null(dim(each[[1L]]))) {
    unlist(each)
  } else {
    shape <- dim(each[[1L]])[-1L]
    flat <- do.call(rbind, lapply(each, matrix, ncol = prod(shape)))
    dim(flat) <- c(nrow(flat), shape)
    flat
  }
}

#' Draw values for several lanes
#' @noRd
sample_lanes <- function(space, n) {
  if (inherits(space, "gym_space_discrete") && is.integer(space$n) && is.integer(space$start)) {
    space$start + sample.int(space$n, n, replace = TRUE) - 1L
  } else if (is_stackable(space)) {
    bounds <- space_bounds(space)
    shape_values(
      draw_numbers(space$dtype, rep(bounds$low, n), rep(bounds$high, n)), c(n, space$shape)
    )
  } else {
    lanes_from(space, replicate(n, space_sample(space), simplify = FALSE))
  }
}

#' Put the numbers of each lane into a row of a matrix
#' @return A matrix, in each row the numbers in row-major order, as Gymnasium flattens
#'   them.
#' @noRd
lane_numbers <- function(lanes) {
  shape <- dim(lanes)
  if (length(shape) == 2L) {
    lanes
  } else if (is.null(shape)) {
    matrix(lanes, ncol = 1L)
  } else {
    t(matrix(row_major(lanes), ncol = shape[[1L]]))
  }
}
