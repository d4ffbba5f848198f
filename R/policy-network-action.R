# From a network's outputs to an action.

network_action <- function(space, outputs, policy, one) {
  if (is_gaussian(policy)) {
    # The step cuts these numbers at the bounds. With candidates, each has its own row of
    # deviations.
    deviation <- exp(policy$log_std)
    if (is.null(dim(deviation))) deviation <- rep(deviation, each = nrow(outputs))
    values <- outputs + deviation * stats::rnorm(length(outputs))
    return(numbers_in_shape(values, space, one))
  }
  if (inherits(space, "gym_space_box")) {
    box_action(space, outputs, policy, one)
  } else {
    discrete_action(space, outputs, policy)
  }
}

discrete_action <- function(space, outputs, policy) {
  chosen <- if (identical(policy$output, "softmax")) {
    draw_by_row(softmax_rows(outputs)) - 1L
  } else if (ncol(outputs) > 1L) {
    max.col(outputs, ties.method = "first") - 1L
  } else if (is.null(space) || space$n > 1L) {
    as.integer(above_half(outputs[, 1L], output_activation(policy)))
  } else {
    integer(nrow(outputs))
  }
  if (identical(policy$output, "epsilon-greedy")) {
    # A single output chooses between two actions, as in greedy networks.
    chosen <- explore(chosen, policy$epsilon, space$n %||% max(ncol(outputs), 2L))
  }
  if (is.null(space)) chosen else chosen + as.integer(space$start)
}

# Replaces some actions by any of `n` actions, from 0.
explore <- function(chosen, epsilon, n) {
  explores <- stats::runif(length(chosen)) < epsilon
  chosen[explores] <- sample.int(n, sum(explores), replace = TRUE) - 1L
  chosen
}

numbers_in_shape <- function(values, space, one) {
  own <- if (is.null(space)) ncol(values) else space$shape
  shape <- if (one) own else c(nrow(values), own)
  if (length(shape) > 1L) aperm(array(t(values), rev(shape))) else as.vector(values)
}

box_action <- function(space, outputs, policy, one) {
  rows <- nrow(outputs)
  low <- rep(space$low, each = rows)
  high <- rep(space$high, each = rows)
  values <- if (has_range(policy)) {
    share <- unit_outputs(outputs, output_activation(policy))
    # A sum of two products, because high - low may exceed the largest number.
    low * (1 - share) + high * share
  } else {
    outputs
  }
  # Rounding may move a value past a bound, and the environment would refuse it.
  values <- pmin(pmax(values, low), high)
  if (space$dtype %in% integer_dtypes) {
    values <- round(values)
  }
  numbers_in_shape(matrix(values, rows), space, one)
}

is_gaussian <- function(policy) identical(policy$output, "gaussian")

# Whether each action has a log-probability.
has_log_prob <- function(policy) policy$output %in% c("softmax", "gaussian")

# The policy that takes the most likely action, or the one with the largest value.
greedy_policy <- function(policy) {
  if (!inherits(policy, "gym_policy_network")) {
    return(policy)
  }
  if (is_gaussian(policy) && is.null(policy$action_space)) {
    # The bounds are unknown, but a gaussian policy's actions are always numbers.
    outputs <- policy$sizes[[length(policy$sizes)]]
    policy$action_space <- space_box(rep(-Inf, outputs), rep(Inf, outputs))
  }
  policy$output <- "greedy"
  policy
}

# Must the step cut actions at the bounds? Gaussian networks draw numbers without bounds; actions of
# this package's other policies are within the bounds.
clips_actions <- function(policy) UseMethod("clips_actions")

#' @exportS3Method
clips_actions.default <- function(policy) FALSE

#' @exportS3Method
clips_actions.gym_policy_network <- function(policy) is_gaussian(policy)

#' @exportS3Method
clips_actions.gym_policy_candidates <- function(policy) is_gaussian(policy$policy)

#' @exportS3Method
clips_actions.gym_policy_list <- function(policy) any(vapply(unclass(policy), clips_actions, NA))

#' Cut the numbers of a batch of actions at the bounds of their space
#' @noRd
clip_actions <- function(space, action) {
  n <- if (is.null(dim(action))) length(action) else nrow(action)
  low <- aperm(array(space$low, rev(space$shape)))
  high <- aperm(array(space$high, rev(space$shape)))
  pmin(pmax(action, rep(low, each = n)), rep(high, each = n))
}

output_activation <- function(policy) policy$activation[[length(policy$activation)]]

# Do the outputs have a range that can be stretched to the bounds of an action?
has_range <- function(policy) output_activation(policy) %in% c("tanh", "logistic", "Gompertz")
