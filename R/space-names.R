# The names of observations. A space may have an element `names`: the names of the numbers of an
# array with one dimension, of the parts of a Tuple, or of the column of a Discrete space in tables.
# Values get names after reading, so the code that reads and writes values ignores names.

#' Make the function that adds names to values of a space
#'
#' An environment makes it once, so that each step only sets an attribute.
#' @param space The space of one value.
#' @param batch Whether the function is for batches of values.
#' @return A function of a value, which returns it with names; `NULL` if values have none.
#' @noRd
naming <- function(space, batch = FALSE) {
  labels <- space$names
  if (has_parts(space)) {
    parts <- lapply(unname(space$spaces), naming, batch)
    if (!inherits(space, "gym_space_tuple")) labels <- NULL
    named <- which(!vapply(parts, is.null, NA))
    if (length(named) || !is.null(labels)) {
      function(value) {
        for (i in named) value[[i]] <- parts[[i]](value[[i]])
        if (!is.null(labels)) names(value) <- labels
        value
      }
    }
  } else if (is.null(labels) || !inherits(space, "gym_space_array")) {
    # A single number gets no name, because R would print the name at each step.
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

# Gives a batch the names that it has during play.
named_batch <- function(space, batch) {
  name <- naming(space, batch = TRUE)
  if (is.null(name)) batch else name(batch)
}

# Columns of tables -----------------------------------------------------------------------

#' Put observations into columns
#'
#' Tables of steps have these columns, and users fit models to them. Their names are those of the
#' space, or otherwise `obs_1`, `obs_2`, ...; with the keys of a Dict, names such as
#' `obs_position_1`.
#' @param values Many observations, as returned by [batch_of()].
#' @return A named list of columns.
#' @noRd
observation_columns <- function(space, values) {
  if (!is.null(space$values)) {
    return(as.list(decoded_values(space, values)))
  }
  columns <- value_columns(space, values, "obs")
  if (is_stackable(space)) {
    names(columns) <- number_names(space, length(columns))
  } else if (!is.null(space$names)) {
    names(columns) <- beside_steps(sub("^obs_", "", names(columns)))
  }
  columns
}

#' Name the numbers of an observation that is an array or a single number
#' @param space The observation space, `NULL` if it is unknown.
#' @noRd
number_names <- function(space, n = prod(space$shape)) {
  if (is.null(space$names)) part_columns("obs", seq_len(n)) else beside_steps(space$names)
}

# Adds the prefix `obs_` to a name that another column of the table of steps has, or may have.
beside_steps <- function(names) {
  taken <- names %in% c("candidate", "episode", "step", "reward", "terminated", "truncated") |
    grepl("^(action|next|obs)(_|$)", names)
  paste0(ifelse(taken, "obs_", ""), names, recycle0 = TRUE)
}

part_columns <- function(name, parts) paste0(name, "_", parts, recycle0 = TRUE)

#' Put values of a space into columns
#'
#' Each number of a value has its own column, in row-major order, also in the parts of Tuple and
#' Dict. Values with a variable number of parts have one column, a list.
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
  # unname(), because a number of a matrix with one row keeps the name of its column.
  each <- lapply(seq_len(n), function(i) unname(numbers[, i]))
  parts <- space$names %||% if (n > 1L) seq_len(n)
  stats::setNames(each, if (n == 1L && is.null(parts)) name else part_columns(name, parts))
}

#' @exportS3Method
value_columns.gym_space_discrete <- function(space, values, name) {
  named <- named_numbers(space, values)
  if (is.data.frame(named)) as.list(named) else stats::setNames(list(named), name)
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

# Renames columns as actions: a single column becomes `action`, several get the prefix `action_`.
named_as_actions <- function(columns) {
  parts <- part_columns("action", sub("^action_", "", names(columns)))
  stats::setNames(columns, if (length(columns) == 1L) "action" else parts)
}

# The names of the columns of actions. A column with a partner `next_...` belongs to the state.
columns_of_action <- function(columns) {
  parts <- grep("^action_", columns, value = TRUE)
  parts <- parts[!paste0("next_", parts) %in% columns]
  if ("action" %in% columns || !length(parts)) "action" else parts
}

# Labels ----------------------------------------------------------------------------------

# A Discrete space may have an element `values`: a data frame with a row for each of its numbers,
# which names a state or an action, in one column or several. Code that plays uses the numbers;
# users see the names.

#' Make a Discrete space whose numbers stand for values
#' @param values A data frame with a row for each value.
#' @noRd
labelled_space <- function(values) {
  space <- space_discrete(max(nrow(values), 1L))
  space$values <- values
  space
}

# A text for each number of a Discrete space, or for some of them.
value_labels <- function(space, numbers = state_numbers(space)) {
  if (is.null(space$values)) as.character(numbers) else row_texts(decoded_values(space, numbers))
}

# A text for each row of a data frame.
row_texts <- function(rows, sep = ", ") {
  do.call(paste, c(unname(lapply(rows, as.character)), sep = sep))
}

# The names of these numbers: a data frame with the columns of states or actions.
decoded_values <- function(space, numbers) {
  values <- space$values[numbers - space$start + 1L, , drop = FALSE]
  row.names(values) <- NULL
  values
}

# Like decoded_values(), but one column becomes a vector. Returns the numbers if they have no names.
named_numbers <- function(space, numbers) {
  if (is.null(space$values)) {
    return(numbers)
  }
  values <- decoded_values(space, numbers)
  if (length(values) == 1L) values[[1L]] else values
}

# Actions as columns of a table.
decoded_actions <- function(space, numbers) {
  data.frame(value_columns(space, numbers, "action"), check.names = FALSE)
}

#' Find the numbers of named values
#' @param x A vector of values or their labels, or a data frame with the columns of the values.
#' @param what What they are, for the error, such as `"state"`.
#' @noRd
encoded_values <- function(space, x, what, call) {
  if (is.null(space$values)) {
    return(if (is.factor(x)) as.integer(as.character(x)) else as.integer(x))
  }
  if (is.data.frame(x)) {
    check_columns(x, names(space$values), what, call)
    x <- row_texts(as.data.frame(x)[names(space$values)])
  }
  place <- match(as.character(x), value_labels(space))
  if (anyNA(place)) {
    abort_wrong(
      NULL, x, call, "There is no {what} {describe_value(as.character(x)[is.na(place)][[1L]])}.",
      i = did_you_mean(as.character(x)[is.na(place)][[1L]], value_labels(space), "\"%s\""),
      i = "There are {few_names(value_labels(space))}."
    )
  }
  as.integer(space$start) + place - 1L
}
