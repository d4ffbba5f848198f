# Discrete: one of n consecutive whole numbers.

#' @exportS3Method
init_space.gym_space_discrete <- function(space) {
  space$n <- whole_from_json(space$n)
  space$start <- if (is.null(space$start)) 0L else whole_from_json(space$start)
  space$dtype <- space$dtype %||% "int64"
  space
}

#' @exportS3Method
space_label.gym_space_discrete <- function(space) {
  from <- if (space$start != 0) paste(" from", whole_text(space$start))
  paste0("Discrete ", whole_text(space$n), from)
}

#' @exportS3Method
space_bounds.gym_space_discrete <- function(space) {
  start <- as.double(space$start)
  list(low = start, high = start + (as.double(space$n) - 1))
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

# Called in nearly every step: the usual case, the last one, is fast.
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
