# Reads observations that a user gives to a policy, one or many: by name where names are known,
# otherwise by position. Observations in play have the order of the space and do not need this.

#' Put one or many observations into the rows of a matrix
#'
#' @param space The observation space. `NULL` for a policy without one, which takes a vector for one
#'   observation and a matrix for many.
#' @param n The number of numbers of an observation, if `space` is `NULL` and it is known.
#' @param arg The name of the argument, for errors.
#' @return A list: `values`, a matrix with an observation in each row, its numbers in row-major
#'   order, as Gymnasium flattens them; `one`, whether `observation` was a single observation and
#'   not a batch.
#' @noRd
observation_rows <- function(observation, space, n = NULL, arg = "observation",
                             call = rlang::caller_env()) {
  plain_numbers(observation, arg, call)
  # The number of dimensions of an observation: none in a discrete space, which has no shape.
  rank <- if (is.null(space)) 1L else length(space$shape)
  observation <- numbers_by_name(observation, space, n, arg, call)
  if (is.null(observation)) abort_argument(observation, "an observation", arg, call)
  if (rank == 0L && prod(dim(observation)[-1L]) != 1) {
    must <- paste("one value of", format(space), "in each row instead of several")
    abort_argument(observation, must, arg, call)
  }
  if (is.data.frame(observation)) {
    return(list(values = unname(frame_rows(observation)), one = FALSE))
  }
  axes <- dim(observation)
  if (is.null(axes) && rank == 1L) {
    return(list(values = matrix(observation, nrow = 1L), one = TRUE))
  }
  given <- if (!is.null(axes)) length(axes) else if (length(observation) == 1L) 0L else 1L
  if (given == rank) {
    list(values = matrix(row_major(observation), nrow = 1L), one = TRUE)
  } else if (rank == 0L || is.null(axes)) {
    list(values = matrix(observation, ncol = 1L), one = FALSE)
  } else {
    values <- matrix(row_major(observation), prod(axes[-1L]), axes[[1L]])
    list(values = t(values), one = FALSE)
  }
}

#' Put one or many observations into a batch
#'
#' @param space The observation space. If it has parts, `observation` is one observation, or a data
#'   frame with a column for each part.
#' @inheritParams observation_rows
#' @return A list: `batch`, with the names that it has in play; `n`, the number of observations;
#'   `one`, whether `observation` was a single observation and not a batch.
#' @noRd
observed_batch <- function(observation, space, arg = "observation", call = rlang::caller_env()) {
  if (is_stackable(space)) {
    rows <- observation_rows(observation, space, arg = arg, call = call)
    n <- nrow(rows$values)
    rank <- length(space$shape)
    batch <- if (rank == 0L) {
      rows$values[, 1L]
    } else if (rank == 1L) {
      rows$values
    } else {
      shape_values(row_major(rows$values), c(n, space$shape))
    }
    return(list(batch = named_batch(space, batch), n = n, one = rows$one))
  }
  one <- !is.data.frame(observation)
  n <- if (one) 1L else nrow(observation)
  batch <- parts_by_name(observation, space, arg, call)
  if (one) {
    check_value(space, batch, "", call)
    batch <- batch_of(space, list(in_order(space, batch)))
  }
  list(batch = named_batch(space, batch), n = n, one = one)
}

# By name ------------------------------------------------------------------------------

# The numbers of observations in the order of the space. If the space has no names of its own, the
# user's names are only labels.
numbers_by_name <- function(observation, space, n, arg, call) {
  rank <- if (is.null(space)) 1L else length(space$shape)
  given <- if (is.data.frame(observation)) {
    names(observation)
  } else if (is.null(dim(observation))) {
    # Several values of a Discrete space may each have a label.
    if (rank == 1L) names(observation)
  } else if (length(dim(observation)) == 2L && rank <= 1L) {
    colnames(observation)
  }
  known <- if (!is.null(space)) {
    number_names(space, if (inherits(space, "gym_space_discrete")) 1L else prod(space$shape))
  } else if (!is.null(n)) {
    number_names(NULL, n)
  }
  if (is.null(given) || is.null(space$names) && !any(given %in% known)) {
    return(observation)
  }
  at <- places_by_name(given, known, space$names, is.data.frame(observation), arg, call)
  if (is.null(dim(observation))) observation[at] else observation[, at, drop = FALSE]
}

# The parts of observations: a list with the names and the order of the space. A single value of a
# Dict is returned as it is, because check_value() compares its keys.
parts_by_name <- function(observation, space, arg, call) {
  keys <- names(space$spaces)
  if (!is.list(observation) || !is.null(keys) && !is.data.frame(observation)) {
    return(observation)
  }
  own <- space$names %||% keys
  known <- if (is.null(space$names)) {
    part_columns("obs", keys %||% seq_along(space$spaces))
  } else {
    beside_steps(own)
  }
  given <- names(observation)
  if (is.null(given) || is.null(own) && !any(given %in% known)) {
    return(as.list(observation))
  }
  at <- places_by_name(given, known, own, is.data.frame(observation), arg, call)
  stats::setNames(as.list(observation)[at], own)
}

#' Find the places of known names among given ones
#'
#' @param known The names in the table of steps.
#' @param own The names of the space, which the user may give instead of those of the table; `NULL`
#'   for none.
#' @param open Whether there may be further names, as in a data frame.
#' @noRd
places_by_name <- function(given, known, own, open, arg, call) {
  of_own <- match(given, own)
  stands <- !is.na(of_own) & !known[of_own] %in% given
  given[stands] <- known[of_own[stands]]
  absent <- setdiff(known, given)
  strange <- if (!open) c(setdiff(given, known), given[duplicated(given)])
  abort_if(
    length(absent) || length(strange), arg, given, call,
    '`{arg}` must have the names of the observations{
     if (length(absent)) paste0("; it has no ", quoted_names(absent))}{
     if (length(strange)) paste0("; it has ", quoted_names(unique(strange)))}.',
    i = "Their names are {few_names(known)}.",
    i = if (!open) "Without names, numbers are taken by position: `unname()` removes them."
  )
  match(known, given)
}
