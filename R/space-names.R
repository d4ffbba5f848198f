# The names of observations. A space may have an element `names`: for an array of one dimension the
# names of its numbers, for a Tuple those of its parts, for a Discrete space the name of its number
# in tables. Values get their names after reading; code that reads and writes them does not need
# names.

#' Make the function that adds names to values of a space
#'
#' It is made once for an environment, so that each step only sets an attribute.
#' @param space The space of one value.
#' @param batch Whether the function is for batches of values.
#' @return A function of a value, which returns it with names; `NULL` if values have none.
#' @noRd
naming <- function(space, batch = FALSE) {
  labels <- space$names
  if (has_parts(space)) {
    parts <- lapply(unname(space$spaces), naming, batch)
    naming_of_parts(parts, if (inherits(space, "gym_space_tuple")) labels)
  } else if (is.null(labels) || !inherits(space, "gym_space_array")) {
    # A single number has none: it would be printed with its name at each step.
    NULL
  } else if (batch) {
    labels <- list(NULL, labels)
    function(value) {
      dimnames(value) <- labels
      value
    }
  } else {
    function(value) {
      names(value) <- labels
      value
    }
  }
}

# A batch with the names that it has in play.
named_batch <- function(space, batch) {
  name <- naming(space, batch = TRUE)
  if (is.null(name)) batch else name(batch)
}

naming_of_parts <- function(parts, labels) {
  named <- which(!vapply(parts, is.null, NA))
  if (!length(named) && is.null(labels)) {
    return(NULL)
  }
  function(value) {
    for (i in named) {
      value[[i]] <- parts[[i]](value[[i]])
    }
    if (!is.null(labels)) names(value) <- labels
    value
  }
}

# Columns of tables -----------------------------------------------------------------------

#' Put observations into columns
#'
#' The columns of the table of steps, which models are fitted to. They have the names of the space,
#' or otherwise `obs_1`, `obs_2`, ..., with the keys of a Dict such as `obs_position_1`.
#' @param values Many observations, as returned by [batch_of()].
#' @return A named list of columns.
#' @noRd
observation_columns <- function(space, values) {
  if (!is.null(space$values)) {
    return(as.list(decoded_values(space, values)))
  }
  columns <- value_columns(space, values, "obs")
  names(columns) <- if (is_stackable(space)) {
    number_names(space, length(columns))
  } else if (!is.null(space$names)) {
    beside_steps(sub("^obs_", "", names(columns)))
  } else {
    names(columns)
  }
  columns
}

#' Name the numbers of an observation that is an array or a single number
#' @param space The observation space, `NULL` if it is unknown.
#' @noRd
number_names <- function(space, n = prod(space$shape)) {
  if (is.null(space$names)) {
    paste0("obs_", seq_len(n), recycle0 = TRUE)
  } else {
    beside_steps(space$names)
  }
}

# A name that another column of the table of steps has, or may have, gets the prefix `obs_`.
beside_steps <- function(names) {
  taken <- names %in% c("candidate", "episode", "step", "reward", "terminated", "truncated") |
    grepl("^(action|next|obs)(_|$)", names)
  paste0(ifelse(taken, "obs_", ""), names, recycle0 = TRUE)
}

part_columns <- function(name, parts) paste0(name, "_", parts, recycle0 = TRUE)

#' Put values of a space into columns
#'
#' Numbers have a column each, in row-major order; so have the parts of Tuple and Dict. Values with
#' a variable number of parts have one column that is a list.
#' @param values The values, as returned by [batch_of()].
#' @param name Their name, such as `"action"`.
#' @return A named list of columns.
#' @noRd
value_columns <- function(space, values, name) UseMethod("value_columns")

#' @exportS3Method
value_columns.default <- function(space, values, name) stats::setNames(list(I(values)), name)

#' @exportS3Method
value_columns.gym_space_array <- function(space, values, name) {
  numbers <- number_rows(values)
  n <- ncol(numbers)
  # In a matrix of one row with named columns the number would keep its name.
  each <- lapply(seq_len(n), function(i) unname(numbers[, i]))
  parts <- space$names %||% if (n > 1L) seq_len(n)
  stats::setNames(each, if (n == 1L && is.null(parts)) name else part_columns(name, parts))
}

#' @exportS3Method
value_columns.gym_space_discrete <- function(space, values, name) {
  stats::setNames(list(named_numbers(space, values)), name)
}

#' @exportS3Method
value_columns.gym_space_text <- value_columns.gym_space_discrete

#' @exportS3Method
value_columns.gym_space_tuple <- function(space, values, name) {
  parts <- names(space$spaces) %||% space$names %||% seq_along(space$spaces)
  columns <- Map(value_columns, unname(space$spaces), unname(values), part_columns(name, parts))
  do.call(c, unname(columns))
}

#' @exportS3Method
value_columns.gym_space_dict <- value_columns.gym_space_tuple
