# Arrays: in R the first index changes fastest, in Python and in messages ("row by row") the last.

# Puts elements given row by row (last index fastest) into an array.
shape_values <- function(values, shape) {
  if (length(shape) <= 1L) {
    return(values)
  }
  wide <- is_integer64(values)
  values <- unclass(values)
  if (length(shape) == 2L) {
    # Takes a third of the time of aperm().
    values <- matrix(values, shape[[1L]], shape[[2L]], byrow = TRUE)
  } else {
    dim(values) <- rev(shape)
    values <- aperm(values)
  }
  if (wide) structure(values, class = "integer64") else values
}

# The elements of an array row by row (last index fastest), as in messages.
row_major <- function(x) {
  if (!is.object(x) || !is_integer64(x)) {
    return(if (length(dim(x)) > 1L) as.vector(aperm(x)) else as.vector(x))
  }
  structure(row_major(unclass(x)), class = "integer64")
}

array_shape <- function(x) dim(x) %||% length(x)

shape_text <- function(shape) paste0("[", paste(shape, collapse = ", "), "]")
