# From a network's outputs to an action.

network_action <- function(space, outputs, policy, one) {
  if (inherits(space, "gym_space_box")) {
    box_action(space, outputs, policy, one)
  } else {
    discrete_action(space, outputs, policy)
  }
}

discrete_action <- function(space, outputs, policy) {
  chosen <- if (ncol(outputs) > 1L) {
    max.col(outputs, ties.method = "first") - 1L
  } else if (is.null(space) || space$n > 1L) {
    as.integer(above_half(outputs[, 1L], output_activation(policy)))
  } else {
    integer(nrow(outputs))
  }
  if (is.null(space)) chosen else chosen + as.integer(space$start)
}

box_action <- function(space, outputs, policy, one) {
  rows <- nrow(outputs)
  low <- rep(space$low, each = rows)
  high <- rep(space$high, each = rows)
  values <- if (has_range(policy)) {
    share <- unit_outputs(outputs, output_activation(policy))
    # The sum of two products, because high - low may be beyond the largest number.
    low * (1 - share) + high * share
  } else {
    outputs
  }
  # Rounding must not move a value past a bound, which the environment would refuse.
  values <- pmin(pmax(values, low), high)
  if (space$dtype %in% integer_dtypes) {
    values <- round(values)
  }
  shape <- if (one) space$shape else c(rows, space$shape)
  if (length(shape) > 1L) aperm(array(t(values), rev(shape))) else as.vector(values)
}

output_activation <- function(policy) policy$activation[[length(policy$activation)]]

# Have the outputs a range, from which they can be stretched to the bounds of an action?
has_range <- function(policy) output_activation(policy) %in% c("tanh", "logistic", "Gompertz")
