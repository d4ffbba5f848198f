#' Decide by a small neural network
#'
#' Makes a network without biases and draws its weights, uniformly between -1 and
#' 1, from R's generator. Each layer multiplies what comes in by its weights and
#' applies its activation.
#'
#' # From outputs to an action
#'
#' What the outputs mean depends on the environment's action space, which the
#' policy learns from [rollout()] and [search_random()] (before that it takes
#' itself to be in an environment with the actions 0, 1, ...):
#'
#' - One output and two actions: the output, scaled to the range from 0 to 1, is
#'   rounded, as in the tutorial *Artificial Intelligence in R (I)* (2018). Exactly one
#'   half gives the first action, as [round()] gives 0.
#' - As many outputs as actions: the action with the largest output, of equal ones
#'   the first. Where the actions do not start at 0, the first output is the first
#'   action all the same.
#' - A Box with as many numbers as there are outputs: each output is stretched
#'   from its own range to the bounds of its number, so that `"tanh"` at -1 gives
#'   the lower bound, at 0 the middle and at 1 the upper bound. (Whole numbers, where
#'   the Box has such, are rounded.) A Box with an unbounded side has no such scale
#'   and is refused.
#'
#' The range of `"logistic"` and `"Gompertz"` goes from 0 to 1, that of `"tanh"`
#' from -1 to 1. `"ReLU"` and `"leakyReLU"` have none, and as the last activation
#' serve only where the largest output is taken.
#'
#' # Observations
#'
#' A Box gives as many inputs as it has numbers (of an array: row by row, as
#' Gymnasium flattens it). A discrete observation, the field of a board for
#' instance, gives one input for each of its values: 1 for the one observed, 0 for
#' the others.
#'
#' @param sizes How many inputs, neurons in each hidden layer, and outputs there
#'   are: whole numbers, at least two of them. The default, `c(4, 2, 1)`, is the
#'   network of the tutorial: 4 x 2 + 2 x 1 = 10 weights.
#' @param activation The activations' names: one of the hidden layers and one of
#'   the outputs (the default, `c("tanh", "logistic")`, as in the tutorial), or one for
#'   each layer after the inputs. `"tanh"` and `"logistic"` are computed with base
#'   R; `"Gompertz"`, `"ReLU"` and `"leakyReLU"` come from the package sigmoid,
#'   which must then be installed.
#' @param weights The weights: a list of matrices, one for each layer after the
#'   inputs, with one row for each neuron of the layer and one column for each of
#'   the layer before. `NULL`, the default, draws them.
#' @return A policy of class `gym_policy_network`, for [act()], [rollout()] and
#'   [search_random()]; a list with the elements `sizes` (integers), `activation`
#'   (strings, one for each layer), `weights` (a list of matrices),
#'   `observation_space`, `action_space` (spaces) and `env_id` (the id of the environment, a
#'   string), all `NULL` until it is played.
#' @section Errors: `gym_error_argument` when sizes, activations and weights do not
#'   fit each other, or a package is missing; from [act()] when the observation
#'   does not have as many numbers as there are inputs.
#' @references The network and the way its weights are drawn are those of the tutorial,
#'   whose code computes the activations with the package sigmoid.
#' @seealso [plot()][plot.gym_policy_network()] draws a network, [decision_map()] what it
#'   does; [policy_random()].
#' @export
#' @examples
#' set.seed(1)
#' policy <- policy_network(sizes = c(4, 2, 1))
#' policy
#' policy$weights
#' act(policy, c(0.01, -0.2, 0.03, 0.4))
#'
#' # The weights may be given, and need not be random: this one follows the pole.
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 1), nrow = 1)))
#' act(follow, rbind(c(0, 0, 0.1, 0), c(0, 0, -0.1, 0)))
policy_network <- function(sizes = c(4, 2, 1), activation = c("tanh", "logistic"),
                           weights = NULL) {
  check_sizes(sizes)
  sizes <- as.integer(sizes)
  activation <- layer_activations(activation, sizes)
  if (is.null(weights)) {
    weights <- draw_weights(sizes)
  } else {
    check_weights(weights, sizes)
  }
  structure(
    list(
      sizes = sizes,
      activation = activation,
      weights = weights,
      observation_space = NULL,
      action_space = NULL,
      env_id = NULL
    ),
    class = c("gym_policy_network", "gym_policy")
  )
}

check_sizes <- function(sizes, call = rlang::caller_env()) {
  if (!is.numeric(sizes) || length(sizes) < 2L) {
    abort_argument(sizes, "two or more whole numbers", "sizes", call)
  }
  for (i in seq_along(sizes)) {
    check_count(sizes[[i]], arg = paste0("sizes[", i, "]"), call = call)
  }
}

# The weights are drawn in the order of the tutorial: first the matrix of the hidden layer, then
# the weights of the output.
draw_weights <- function(sizes) {
  Map(
    function(inputs, outputs) {
      matrix(stats::runif(inputs * outputs, -1, 1), nrow = outputs, ncol = inputs)
    },
    sizes[-length(sizes)],
    sizes[-1L]
  )
}

check_weights <- function(weights, sizes, name = "weights", call = rlang::caller_env()) {
  wanted <- Map(c, sizes[-1L], sizes[-length(sizes)])
  if (!is.list(weights) || length(weights) != length(wanted)) {
    shapes <- vapply(wanted, paste, "", collapse = " x ")
    must <- paste0("a list of ", length(wanted), " matrices (", paste(shapes, collapse = ", "), ")")
    abort_argument(weights, must, name, call)
  }
  for (i in seq_along(wanted)) {
    arg <- paste0(name, "[[", i, "]]")
    layer <- weights[[i]]
    if (!is.matrix(layer) || !is.numeric(layer)) {
      abort_argument(layer, "a numeric matrix", arg, call)
    }
    if (!identical(dim(layer), wanted[[i]])) {
      turned <- identical(rev(dim(layer)), wanted[[i]])
      gym_abort(
        c(
          paste0("`", arg, "` must be a matrix of ", paste(wanted[[i]], collapse = " x "),
                 " for these sizes, not of ", paste(dim(layer), collapse = " x "), "."),
          i = if (turned) "`t()` turns it: a row is a neuron, a column one of what it takes."
        ),
        class = "gym_error_argument", argument = arg, value = layer, call = call
      )
    }
    if (anyNA(layer)) {
      abort_argument(layer, "without missing values", arg, call)
    }
  }
}

# The weights as one vector, layer after layer, each matrix column after column.
weight_vector <- function(policy) unlist(lapply(policy$weights, as.vector))

with_weights <- function(policy, weights) {
  policy$weights <- utils::relist(weights, policy$weights)
  policy
}

# From an observation to an action -------------------------------------------------

#' @export
act.gym_policy_network <- function(policy, observation, ...) {
  # The weights may have been changed by hand.
  check_weights(policy$weights, policy$sizes, "policy$weights")
  rows <- observation_rows(observation, policy$observation_space)
  outputs <- network_outputs(policy, rows$values)
  network_action(policy$action_space, outputs, policy, rows$one)
}

#' @exportS3Method
act_batch.gym_policy_network <- function(policy, observation, n, vector_env) {
  outputs <- network_outputs(policy, number_rows(observation))
  network_action(policy$action_space, outputs, policy, one = FALSE)
}

# The numbers of an observation with several dimensions are taken in the order in which R has them,
# column after column, and the weights of the inputs are put into this order once.
#' @exportS3Method
policy_rows.gym_policy_network <- function(policy, candidate) {
  shape <- policy$observation_space$shape
  if (length(shape) > 1L && prod(shape) == policy$sizes[[1L]]) {
    by_row <- aperm(array(seq_len(prod(shape)), rev(shape)))
    policy$weights[[1L]] <- policy$weights[[1L]][, by_row, drop = FALSE]
    class(policy) <- c("gym_policy_by_column", class(policy))
  }
  policy
}

#' @exportS3Method
act_batch.gym_policy_by_column <- function(policy, observation, n, vector_env) {
  dim(observation) <- c(n, length(observation) / n)
  network_action(policy$action_space, network_outputs(policy, observation), policy, one = FALSE)
}

#' Compute the outputs for rows of observations
#' @return A matrix with one row for each observation, one column for each output.
#' @noRd
network_outputs <- function(policy, values, call = rlang::caller_env()) {
  signal <- network_inputs(policy$observation_space, values, call)
  if (ncol(signal) != policy$sizes[[1L]] || !is.numeric(signal)) {
    abort_observation(policy, values, call)
  }
  for (layer in seq_along(policy$weights)) {
    signal <- activate(tcrossprod(signal, policy$weights[[layer]]), policy$activation[[layer]])
  }
  signal
}

abort_observation <- function(policy, values, call) {
  given <- if (is.numeric(values)) {
    paste("has", count_of(ncol(values), "number"))
  } else {
    paste("is of type", typeof(values))
  }
  gym_abort(
    paste0("The network takes ", count_of(policy$sizes[[1L]], "input"),
           ", but the observation ", given, "."),
    class = "gym_error_argument", argument = "observation", value = values, call = call
  )
}

network_inputs <- function(space, values, call = rlang::caller_env()) {
  if (!inherits(space, "gym_space_discrete")) {
    return(values)
  }
  at <- if (is.numeric(values)) values[, 1L] - space$start + 1 else NA
  if (anyNA(at) || any(at < 1 | at > space$n | at != trunc(at))) {
    must <- paste("whole numbers from", space$start, "to", space$start + space$n - 1L)
    abort_argument(as.vector(values), must, "observation", call)
  }
  inputs <- matrix(0, nrow = nrow(values), ncol = space$n)
  inputs[cbind(seq_len(nrow(values)), at)] <- 1
  inputs
}

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
    check_range(policy)
    as.integer(round(unit_outputs(outputs[, 1L], output_activation(policy))))
  } else {
    integer(nrow(outputs))
  }
  if (is.null(space)) chosen else chosen + as.integer(space$start)
}

box_action <- function(space, outputs, policy, one) {
  share <- unit_outputs(outputs, output_activation(policy))
  rows <- nrow(outputs)
  low <- rep(space$low, each = rows)
  high <- rep(space$high, each = rows)
  # The sum of two products, because high - low may be beyond the largest number. Rounding must not
  # move a value past a bound, which the environment would refuse.
  values <- pmin(pmax(low * (1 - share) + high * share, low), high)
  if (space$dtype %in% integer_dtypes) {
    values <- round(values)
  }
  shape <- if (one) space$shape else c(rows, space$shape)
  if (length(shape) > 1L) aperm(array(t(values), rev(shape))) else as.vector(values)
}

output_activation <- function(policy) policy$activation[[length(policy$activation)]]

check_range <- function(policy, call = rlang::caller_env()) {
  activation <- output_activation(policy)
  if (!activation %in% c("tanh", "logistic", "Gompertz")) {
    gym_abort(
      c(
        paste0("The output's activation \"", activation, "\" has no upper end, so that the ",
               "output cannot be rounded or scaled to an action."),
        i = "\"logistic\" and \"tanh\" can."
      ),
      class = "gym_error_argument", argument = "activation", value = activation, call = call
    )
  }
}

# Drawing again, and printing ------------------------------------------------------

#' @exportS3Method
policy_resample.gym_policy_network <- function(policy, call = rlang::caller_env()) {
  policy$weights <- draw_weights(policy$sizes)
  policy
}

#' @export
format.gym_policy_network <- function(x, ...) {
  paste0(
    "network ", paste(x$sizes, collapse = "-"), ", ", paste(x$activation, collapse = ", "),
    ", ", count_of(sum(lengths(x$weights)), "weight")
  )
}
