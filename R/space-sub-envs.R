# Values of several sub-environments, put together and taken apart. Numbers are in an array with the
# sub-environments along its first dimension (in a vector, for single numbers), texts in a character
# vector, the values of Tuple and Dict in a list of such parts, other values in a list.

has_parts <- function(space) {
  inherits(space, "gym_space_tuple") || inherits(space, "gym_space_dict")
}

# Calls a function for each part of a Tuple or Dict.
map_parts <- function(space, part, ...) {
  parts <- Map(part, unname(space$spaces), ...)
  names(parts) <- names(space$spaces)
  parts
}

#' Put the single values of sub-environments together
#' @param values A list of values of the space.
#' @noRd
sub_envs_from <- function(space, values) {
  if (is_stackable(space)) {
    stack_values(space, values)
  } else if (inherits(space, "gym_space_text")) {
    as.character(values)
  } else if (has_parts(space)) {
    each <- lapply(seq_along(space$spaces), function(i) lapply(values, function(v) v[[i]]))
    map_parts(space, sub_envs_from, each)
  } else {
    values
  }
}

#' Take the value of one sub-environment
#' @noRd
sub_env_value <- function(space, sub_envs, i) {
  if (has_parts(space)) {
    map_parts(space, sub_env_value, in_order(space, sub_envs), i)
  } else if (is_stackable(space)) {
    value <- rows_of(sub_envs, i)
    dim(value) <- if (length(space$shape) > 1L) dim(value)[-1L]
    value
  } else {
    sub_envs[[i]]
  }
}

#' Take the values of some sub-environments
#' @param i Their numbers; one may come more than once.
#' @noRd
sub_env_rows <- function(space, sub_envs, i) {
  if (has_parts(space)) {
    map_parts(space, sub_env_rows, in_order(space, sub_envs), list(i))
  } else {
    rows_of(sub_envs, i)
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

# The parts in the order of the space: a policy may name those of a Dict in any order.
in_order <- function(space, parts) {
  keys <- names(space$spaces)
  if (is.null(keys) || is.null(names(parts))) parts else parts[match(keys, enc2utf8(names(parts)))]
}

#' Put the sub-environments of several values after each other
#' @param each A list of values of sub-environments, at least one.
#' @noRd
bind_sub_envs <- function(space, each) {
  if (has_parts(space)) {
    parts <- lapply(seq_along(space$spaces), function(i) {
      lapply(each, function(sub_envs) in_order(space, sub_envs)[[i]])
    })
    map_parts(space, bind_sub_envs, parts)
  } else if (!is_stackable(space)) {
    do.call(c, each)
  } else if (any(vapply(each, inherits, NA, "integer64"))) {
    # Other values may be integer or double, as integer64 stands for the numbers beyond 2^53 only.
    digits <- unlist(lapply(each, function(sub_envs) whole_text(row_major(sub_envs))))
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

#' Draw values for several sub-environments
#' @noRd
sample_sub_envs <- function(space, n) {
  if (inherits(space, "gym_space_discrete") && is.integer(space$n) && is.integer(space$start)) {
    space$start + sample.int(space$n, n, replace = TRUE) - 1L
  } else if (is_stackable(space)) {
    bounds <- space_bounds(space)
    shape_values(
      draw_numbers(space$dtype, rep(bounds$low, n), rep(bounds$high, n)), c(n, space$shape)
    )
  } else {
    sub_envs_from(space, replicate(n, space_sample(space), simplify = FALSE))
  }
}

#' Put the numbers of each sub-environment into a row of a matrix
#' @return A matrix, in each row the numbers in row-major order, as Gymnasium flattens
#'   them.
#' @noRd
sub_env_numbers <- function(sub_envs) {
  shape <- dim(sub_envs)
  if (length(shape) == 2L) {
    sub_envs
  } else if (is.null(shape)) {
    matrix(sub_envs, ncol = 1L)
  } else {
    t(matrix(row_major(sub_envs), ncol = shape[[1L]]))
  }
}
