# Arrays: in R the first index changes fastest, in Python and in messages ("row by row") the last.

# Puts elements given row by row (last index fastest) into an array.
shape_values <- function(values, shape) {
  if (length(shape) <= 1L) {
    return(values)
  }
  if (length(shape) == 2L) {
    # Takes a third of the time of aperm().
    matrix(values, shape[[1L]], shape[[2L]], byrow = TRUE)
  } else {
    dim(values) <- rev(shape)
    aperm(values)
  }
}

# The elements of an array row by row (last index fastest), as in messages.
row_major <- function(x) if (length(dim(x)) > 1L) as.vector(aperm(x)) else as.vector(x)

array_shape <- function(x) dim(x) %||% length(x)

shape_text <- function(shape) paste0("[", paste(shape, collapse = ", "), "]")

# Rows ------------------------------------------------------------------------------------

softmax_rows <- function(values, temperature = 1) {
  weight <- exp((values - row_max(values)) / temperature)
  weight / rowSums(weight)
}

# Draws a column for each row of a matrix of probabilities.
draw_by_row <- function(p) {
  u <- stats::runif(nrow(p))
  choice <- rep(1L, nrow(p))
  below <- numeric(nrow(p))
  last <- max.col(p > 0, "last")
  for (column in seq_len(ncol(p) - 1L)) {
    below <- below + p[, column]
    choice <- choice + (u >= below)
  }
  # The sum of the probabilities may be a little below 1.
  pmin(choice, last)
}

# The largest number in each row and its column, the first of several. An episode asks about a
# single row in each step.
row_max <- function(x) {
  if (nrow(x) == 1L) max(x) else x[cbind(seq_len(nrow(x)), max.col(x, "first"))]
}
best_column <- function(x) if (nrow(x) == 1L) which.max(x) else max.col(x, "first")

# The column of the largest number in each row; of several one is drawn.
any_best_column <- function(x) {
  column <- max.col(x, "first")
  tied <- which(column != max.col(x, "last"))
  if (length(tied)) {
    rows <- x[tied, , drop = FALSE]
    best <- rows == row_max(rows)
    column[tied] <- max.col(best * (1 + stats::runif(length(rows))), "first")
  }
  column
}
