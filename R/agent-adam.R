# Adam (Kingma and Ba 2015, Algorithm 1), and gradient clipping.

new_adam <- function(count) list(mean = numeric(count), square = numeric(count), steps = 0)

#' Take a step down a gradient
#' @param weights,gradient Vectors of the same length.
#' @param adam The moments so far, as returned by new_adam() or by this function.
#' @param epsilon Keeps the divisor away from 0.
#' @return A list: `weights` and `adam`.
#' @noRd
adam_step <- function(weights, gradient, adam, learning_rate, epsilon = 1e-8) {
  # An operation with all weights takes some percent of an update, so there are few of them: this
  # mean is 0.9 * mean + 0.1 * gradient.
  steps <- adam$steps + 1
  mean <- adam$mean + 0.1 * (gradient - adam$mean)
  square <- adam$square + 0.001 * (gradient * gradient - adam$square)
  size <- learning_rate / (1 - 0.9^steps)
  weights <- weights - size * (mean / (sqrt(square) * (1 / sqrt(1 - 0.999^steps)) + epsilon))
  list(weights = weights, adam = list(mean = mean, square = square, steps = steps))
}

# Shortens a gradient to the length `longest` if it is longer.
clip_norm <- function(gradient, longest) {
  norm <- sqrt((gradient %*% gradient)[[1L]])
  if (isTRUE(norm > longest)) gradient * (longest / (norm + 1e-6)) else gradient
}
