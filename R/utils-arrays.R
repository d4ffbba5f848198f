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
