# A Discrete space may have an element `values`: a data frame with a row for each of its numbers,
# the name of a state (in several columns, perhaps) or of an action. Numbers play; people see the
# names.

#' Make a Discrete space whose numbers stand for values
#' @param values A data frame with a row for each value.
#' @noRd
labelled_space <- function(values) {
  space <- space_discrete(max(nrow(values), 1L))
  space$values <- values
  space
}

# A text for each number of a Discrete space.
value_labels <- function(space) {
  if (is.null(space$values)) {
    return(as.character(state_numbers(space)))
  }
  row_texts(space$values)
}

# A text for each row of a data frame.
row_texts <- function(rows, sep = ", ") {
  do.call(paste, c(unname(lapply(rows, as.character)), sep = sep))
}

# The values of these numbers: a data frame of the columns of states.
decoded_values <- function(space, numbers) {
  values <- space$values[numbers - space$start + 1L, , drop = FALSE]
  row.names(values) <- NULL
  values
}

# The same, as a vector if there is one column. Without names they are the numbers.
named_numbers <- function(space, numbers) {
  if (is.null(space$values)) {
    return(numbers)
  }
  values <- decoded_values(space, numbers)
  if (length(values) == 1L) values[[1L]] else value_labels(space)[numbers - space$start + 1L]
}

#' Return the numbers of some values
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
    gym_abort(
      c(paste0("There is no ", what, " ", describe_value(as.character(x)[is.na(place)][[1L]]), "."),
        i = did_you_mean(as.character(x)[is.na(place)][[1L]], value_labels(space), "\"%s\""),
        i = paste0("There are ", few_names(value_labels(space)), ".")),
      class = "gym_error_argument", value = x, call = call
    )
  }
  as.integer(space$start) + place - 1L
}
