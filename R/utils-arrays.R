# Arrays: in R the first index runs fastest, in Python and on the wire ("row by row") the last one.

# Put elements that come row by row (last index fastest) into an array.
shape_values <- function(values, shape) {
  if (length(shape) <= 1L) {
    return(values)
  }
  wide <- is_integer64(values)
  values <- unclass(values)
  if (length(shape) == 2L) {
    # A third of what aperm() takes.
    values <- matrix(values, shape[[1L]], shape[[2L]], byrow = TRUE)
  } else {
    dim(values) <- rev(shape)
    values <- aperm(values)
  }
  if (wide) structure(values, class = "integer64") else values
}

# The elements of an array with its last index running fastest, as on the wire.
row_major <- function(x) {
  if (!is.object(x) || !is_integer64(x)) {
    return(if (length(dim(x)) > 1L) as.vector(aperm(x)) else as.vector(x))
  }
  structure(row_major(unclass(x)), class = "integer64")
}

array_shape <- function(x) dim(x) %||% length(x)

shape_text <- function(shape) paste0("[", paste(shape, collapse = ", "), "]")
