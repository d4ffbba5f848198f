# In an array of R the first index changes fastest. In Python and in messages the last one does
# ("row by row").

# Puts elements given row by row (last index fastest) into an array.
shape_values <- function(values, shape) {
  if (length(shape) <= 1L) {
    values
  } else if (length(shape) == 2L) {
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

# Like split(), but the groups are in the order in which they first occur. Each group may have
# several keys.
split_in_order <- function(x, ...) {
  key <- paste(..., sep = "\r")
  split(x, factor(key, unique(key)))
}

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

# The largest number in each row, and its column: the first one if several are equal. Both are fast
# for a single row, which an episode has in each step.
row_max <- function(x) {
  if (nrow(x) == 1L) max(x) else x[cbind(seq_len(nrow(x)), max.col(x, "first"))]
}
best_column <- function(x) if (nrow(x) == 1L) which.max(x) else max.col(x, "first")

# A row for each choice, with 1 in its column.
one_hot <- function(choice, count) {
  rows <- matrix(0, length(choice), count)
  rows[cbind(seq_along(choice), choice)] <- 1
  rows
}

# The column of the largest number in each row. If several are equal, one of them is drawn.
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

# Moments ---------------------------------------------------------------------------------

# Running moments of observations, which normalise a network's inputs: the count, and for each
# number the mean and the sum of squared deviations from it (`squares`). `scale` is computed from
# these: 1 / standard deviation.
#
# Two sets are merged as in Chan, Golub and LeVeque (1979, "Updating formulae and a pairwise
# algorithm for computing sample variances").

# If the standard deviation of a number is below this, the number becomes 0, as in the code of
# Mania, Guy and Recht (2018), https://github.com/modestyachts/ARS, ARS/filter.py.
least_deviation <- 1e-7

no_moments <- function() list(count = 0, mean = NULL, squares = NULL, scale = NULL)

new_moments <- function(count, mean, squares) {
  # A single observation has no deviation. Use its absolute value, as the authors' code does.
  deviation <- if (count > 1) sqrt(squares / (count - 1)) else abs(mean)
  list(
    count = as.numeric(count), mean = mean, squares = squares,
    scale = ifelse(deviation < least_deviation, 0, 1 / deviation)
  )
}

#' Compute the moments of observations
#' @param values A matrix with an observation in each row.
#' @noRd
moments_of <- function(values) {
  n <- nrow(values)
  mean <- .colMeans(values, n, ncol(values))
  deviations <- values - rep(mean, each = n)
  new_moments(n, mean, .colSums(deviations * deviations, n, ncol(values)))
}

# The order of `x` and `y` affects the last bits.
merge_moments <- function(x, y) {
  if (is.null(x) || x$count == 0) {
    return(y)
  }
  if (is.null(y) || y$count == 0) {
    return(x)
  }
  count <- x$count + y$count
  apart <- y$mean - x$mean
  new_moments(
    count, x$mean + apart * (y$count / count),
    x$squares + y$squares + apart * apart * (x$count * (y$count / count))
  )
}

# Returns the observations unchanged if there are no moments yet. A number that hardly changed in
# training may later be many standard deviations away from its mean. `clip` keeps it from
# outweighing all others. `clip` is NULL in policies saved by versions that did not clip.
normalized <- function(values, moments, clip) {
  if (is.null(moments$mean)) {
    return(values)
  }
  n <- nrow(values)
  values <- (values - rep(moments$mean, each = n)) * rep(moments$scale, each = n)
  if (isTRUE(clip < Inf)) values[] <- pmin.int(pmax.int(values, -clip), clip)
  values
}

reorder_moments <- function(moments, order) {
  if (is.null(moments$mean)) {
    return(moments)
  }
  new_moments(moments$count, moments$mean[order], moments$squares[order])
}
