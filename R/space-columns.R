# Values of one space as the columns of a table.

#' Put values of a space into columns
#'
#' Numbers have a column each, in row-major order; so have the parts of Tuple and
#' Dict. Values that may hold any number of parts have one column that is a list.
#' @param values The values, as [batch_of()] puts them together.
#' @param name What they are, such as `"action"`.
#' @return A named list of columns.
#' @noRd
value_columns <- function(space, values, name) UseMethod("value_columns")

#' @exportS3Method
value_columns.default <- function(space, values, name) stats::setNames(list(I(values)), name)

#' @exportS3Method
value_columns.gym_space_array <- function(space, values, name) {
  numbers <- number_rows(values)
  n <- ncol(numbers)
  each <- lapply(seq_len(n), function(i) numbers[, i])
  stats::setNames(each, if (n == 1L) name else paste0(name, "_", seq_len(n), recycle0 = TRUE))
}

#' @exportS3Method
value_columns.gym_space_discrete <- function(space, values, name) {
  stats::setNames(list(values), name)
}

#' @exportS3Method
value_columns.gym_space_text <- value_columns.gym_space_discrete

#' @exportS3Method
value_columns.gym_space_tuple <- function(space, values, name) {
  columns <- lapply(seq_along(space$spaces), function(i) {
    value_columns(space$spaces[[i]], values[[i]], paste0(name, "_", names(space$spaces)[i] %||% i))
  })
  do.call(c, columns)
}

#' @exportS3Method
value_columns.gym_space_dict <- value_columns.gym_space_tuple
