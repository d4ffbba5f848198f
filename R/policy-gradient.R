#' Differentiate a network by hand
#'
#' Use these functions to write an agent that follows a gradient. They compute how likely a policy's
#' actions were, and how this likelihood changes with the weights. They use matrix algebra and no
#' automatic differentiation.
#'
#' `policy_log_prob()` and `policy_log_prob_gradient()` are for a [policy_network()] with the output
#' `"softmax"`, whose actions have probabilities, or `"gaussian"`, whose actions have densities. A
#' density is that of the numbers as drawn, before they are cut at the bounds of the action space.
#'
#' `policy_output_gradient()` is for any network, such as a value network:
#' `policy_network(c(4, 64, 1), c("tanh", "identity"))` has one output. `predict(type = "output")`
#' returns this output, and `policy_output_gradient()` its gradient.
#'
#' @param policy A network.
#' @param observation Observations, as for [act()]: a matrix with one in each row, or a single one.
#' @param action An action for each observation. For a Discrete action space, a vector of whole
#'   numbers, which start at 0 if the policy has not been played. For a Box, a matrix with an action
#'   in each row.
#' @param weights The weight of each observation, a numeric vector, or one number for all. For
#'   `policy_output_gradient()` and a network with several outputs, a matrix with a row for each
#'   observation and a column for each output. The default is 1.
#' @return `policy_log_prob()` returns a numeric vector with the natural logarithm of a probability
#'   (or density) for each observation. The other two return a numeric vector in the order of
#'   [coef()][coef.gym_policy_network]: the gradient of the sum of `weights` times the logarithms,
#'   or times the outputs. Divide `weights` by the number of observations to get the gradient of a
#'   mean, such as the policy gradient of Sutton and Barto (2018, chapter 13).
#' @section Errors: `gym_error_argument` for another kind of policy, or if observations, actions and
#'   weights do not fit the policy and each other.
#' @references R. J. Williams (1992), Simple statistical gradient-following algorithms for
#'   connectionist reinforcement learning, Machine Learning 8.
#'
#'   R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second edition,
#'   MIT Press.
#' @seealso [agent_reinforce()] and [agent_ppo()], which use these formulas
#' @export
#' @examples
#' set.seed(1)
#' policy <- policy_network(c(4, 8, 2), output = "softmax", init = "orthogonal")
#' observations <- matrix(rnorm(12), ncol = 4)
#' actions <- act(policy, observations)
#' policy_log_prob(policy, observations, actions)
#'
#' # Change the weights so that these actions become more likely.
#' gradient <- policy_log_prob_gradient(policy, observations, actions)
#' coef(policy) <- coef(policy) + 0.1 * gradient
#' policy_log_prob(policy, observations, actions)
policy_log_prob <- function(policy, observation, action) {
  check_draws_known(policy)
  seen <- seen_columns(policy, observation)
  action <- counted_actions(policy, action, ncol(seen))
  forward_draws(policy, weight_vector(policy), seen, action)$draws$log_prob
}

#' @rdname policy_log_prob
#' @export
policy_log_prob_gradient <- function(policy, observation, action, weights = 1) {
  check_draws_known(policy)
  seen <- seen_columns(policy, observation)
  n <- ncol(seen)
  action <- counted_actions(policy, action, n)
  weights <- check_row_weights(weights, n, 1L)[, 1L]
  forward <- forward_draws(policy, weight_vector(policy), seen, action)
  draws_gradient(policy, forward, weights)
}

#' @rdname policy_log_prob
#' @export
policy_output_gradient <- function(policy, observation, weights = 1) {
  check_is_network(policy)
  seen <- seen_columns(policy, observation)
  weights <- check_row_weights(weights, ncol(seen), policy$sizes[[length(policy$sizes)]])
  gradient <- backward_network(forward_network(layers_of(policy), seen), t(weights))
  # The outputs do not depend on the standard deviations.
  c(gradient, if (is_gaussian(policy)) numeric(length(policy$log_std)))
}

# The formulas --------------------------------------------------------------------------------

#' Compute a network's outputs and the log-probabilities of actions
#' @param weights The policy's weights. Other weights may follow them.
#' @param action The actions, numbered from 1; for a Gaussian, a matrix with one in each column.
#' @return As [forward_network()], with `draws`: a list of `log_prob` and `entropy`, vectors, and
#'   the parts of their derivatives.
#' @noRd
forward_draws <- function(policy, weights, inputs, action) {
  forward <- forward_network(layers_of(policy, weights), inputs)
  outputs <- forward$outputs
  k <- nrow(outputs)
  forward$draws <- if (is_gaussian(policy)) {
    count <- count_weights(policy)
    log_std <- weights[(count - k + 1L):count]
    deviation <- exp(log_std)
    z <- (action - outputs) / deviation
    constant <- sum(log_std) + k * log(2 * pi) / 2
    list(
      log_prob = -colSums(z * z) / 2 - constant, entropy = rep(constant + k / 2, ncol(outputs)),
      z = z, deviation = deviation
    )
  } else {
    chosen <- places_of_actions(k, action)
    logs <- outputs - rep(column_max(outputs), each = k)
    logs <- logs - rep(log(colSums(exp(logs))), each = k)
    p <- exp(logs)
    list(
      log_prob = logs[chosen], entropy = -colSums(p * logs), logs = logs, p = p, chosen = chosen
    )
  }
  forward
}

#' Differentiate log-probabilities and entropies with respect to a policy's weights
#' @param forward As returned by [forward_draws()].
#' @param weights,of_entropy The derivatives of the objective with respect to each log-probability,
#'   and each entropy.
#' @noRd
draws_gradient <- function(policy, forward, weights, of_entropy = 0) {
  draws <- forward$draws
  k <- nrow(forward$outputs)
  if (is_gaussian(policy)) {
    by_output <- rep(weights, each = k)
    of_log_std <- rowSums(by_output * (draws$z * draws$z - 1)) +
      sum(rep_len(of_entropy, ncol(draws$z)))
    return(c(backward_network(forward, by_output * draws$z / draws$deviation), of_log_std))
  }
  slopes <- draws$p * -rep(weights, each = k)
  slopes[draws$chosen] <- slopes[draws$chosen] + weights
  if (any(of_entropy != 0)) {
    slopes <- slopes - of_entropy * draws$p * (draws$logs + rep(draws$entropy, each = k))
  }
  backward_network(forward, slopes)
}

column_max <- function(x) {
  largest <- x[1L, ]
  for (row in seq_len(nrow(x))[-1L]) largest <- pmax.int(largest, x[row, ])
  largest
}

# What goes in --------------------------------------------------------------------------------

seen_columns <- function(policy, observation, call = rlang::caller_env()) {
  check_network(policy, call)
  rows <- network_rows(policy, observation, "observation", call)
  t(network_inputs(policy, rows$values, call))
}

# Checks actions and returns them in the form that forward_draws() takes.
counted_actions <- function(policy, action, n, call = rlang::caller_env()) {
  action <- plain_numbers(action, "action", call)
  outputs <- policy$sizes[[length(policy$sizes)]]
  count <- if (is_gaussian(policy)) n * outputs else n
  if (!is.numeric(action) || length(action) != count || anyNA(action)) {
    of <- if (is_gaussian(policy)) paste0(" of ", count_of(outputs, "number"))
    must <- paste0(count_of(n, "action"), of, ", one for each observation")
    abort_argument(action, must, "action", call)
  }
  if (is_gaussian(policy)) {
    if (!is.null(policy$action_space)) {
      action <- action_by_name(policy$action_space, action, policy$env_id, call)
    }
    # If an action has several dimensions, take its numbers row by row.
    return(matrix(row_major(action), outputs))
  }
  counted_from_one(action, policy$action_space$start %||% 0L, outputs, "action", call)
}

# Converts actions, numbered from 1, to places in a matrix with a row for each output and a column
# for each observation.
places_of_actions <- function(outputs, action) (seq_along(action) - 1L) * outputs + action

check_row_weights <- function(weights, n, outputs, call = rlang::caller_env()) {
  fits <- is.numeric(weights) && !anyNA(weights) && (
    length(weights) == 1L || identical(dim(weights), c(n, outputs)) ||
      (outputs == 1L && length(weights) == n)
  )
  if (!fits) {
    must <- if (outputs == 1L) {
      paste("one number, or one for each of", count_of(n, "observation"))
    } else {
      paste("one number, or a matrix of", n, "x", outputs)
    }
    abort_argument(weights, must, "weights", call)
  }
  matrix(weights, n, outputs)
}

check_is_network <- function(policy, call = rlang::caller_env()) {
  if (!inherits(policy, "gym_policy_network")) abort_no_weights(policy, "policy", call)
}

check_draws_known <- function(policy, call = rlang::caller_env()) {
  check_is_network(policy, call)
  abort_if(
    !has_log_prob(policy), "policy", policy, call,
    "Only a network that draws its actions knows their probabilities, not
     {policy_text(policy)}.",
    i = '`policy_network()` with `output = "softmax"` or `"gaussian"` makes one.'
  )
}

# Layers ---------------------------------------------------------------------------------

# Gradients of a network: forward_network() keeps the output of each layer, and backward_network()
# goes from the derivatives of the outputs to those of the weights. Here each observation is a
# column. A minibatch is then a contiguous piece of memory, and R's recycling adds the bias to each
# column. In network_outputs(), as for users, each observation is a row.

#' Split a vector of weights into layers
#' @param policy A network, for its sizes and activations.
#' @param weights Weights in the order of `coef()`, by default the policy's own. Other numbers may
#'   come before and after them.
#' @param start How many numbers come before the weights.
#' @return A list with a list for each layer: `weights`, a matrix with a row for each neuron, `bias`
#'   (`NULL` for none), `activation`.
#' @noRd
layers_of <- function(policy, weights = weight_vector(policy), start = 0L) {
  sizes <- policy$sizes
  bias <- isTRUE(policy$bias)
  layers <- vector("list", length(sizes) - 1L)
  end <- start
  # A loop is fast, and this runs for each minibatch.
  for (i in seq_along(layers)) {
    neurons <- sizes[[i + 1L]]
    count <- neurons * sizes[[i]]
    own <- weights[(end + 1L):(end + count)]
    dim(own) <- c(neurons, sizes[[i]])
    end <- end + count
    layers[[i]] <- list(
      weights = own, bias = if (bias) weights[(end + 1L):(end + neurons)],
      activation = policy$activation[[i]]
    )
    if (bias) end <- end + neurons
  }
  layers
}

#' Compute the output of each layer
#' @param layers As returned by layers_of().
#' @param inputs A matrix with an observation in each column, prepared by network_inputs().
#' @return A list: `outputs`, a matrix with a column for each observation; and for
#'   backward_network() the `layers`, and the `signals`: the inputs, then the outputs of each layer.
#' @noRd
forward_network <- function(layers, inputs) {
  signals <- vector("list", length(layers) + 1L)
  signals[[1L]] <- inputs
  for (i in seq_along(layers)) {
    activation <- layers[[i]]$activation
    signals[[i + 1L]] <- switch(activation,
      # This formula of tanh() has an error of at most 4e-16 and is twice as fast; tanh() takes a
      # third of an update. The sums have no name, so R reuses their memory.
      tanh = 1 - 2 / (exp(2 * layer_sums(layers[[i]], signals[[i]])) + 1),
      ReLU = quick_relu(layer_sums(layers[[i]], signals[[i]])),
      activate(layer_sums(layers[[i]], signals[[i]]), activation)
    )
  }
  list(outputs = signals[[length(signals)]], layers = layers, signals = signals)
}

layer_sums <- function(layer, inputs) {
  if (is.null(layer$bias)) layer$weights %*% inputs else layer$weights %*% inputs + layer$bias
}

# ReLU without a comparison, which is six times as fast. With comparisons it took a third of an
# update. The result is the same for finite numbers.
quick_relu <- function(x) (x + abs(x)) * 0.5

#' Compute the derivatives of the weights
#' @param forward As returned by forward_network().
#' @param slopes The derivatives of the outputs, a matrix of the same shape.
#' @return A vector in the order of `coef()`: the sums over all observations.
#' @noRd
backward_network <- function(forward, slopes) {
  layers <- forward$layers
  signals <- forward$signals
  # The weights and the bias of each layer, in turn.
  gradient <- vector("list", 2L * length(layers))
  ones <- rep(1, ncol(slopes))
  # With R's own BLAS, which most users have, it is twice as fast to transpose a matrix first as to
  # use crossprod(). With faster libraries there is no difference.
  slow <- has_reference_blas()
  for (i in rev(seq_along(layers))) {
    activation <- layers[[i]]$activation
    if (activation != "identity") {
      slopes <- slopes * activation_slope(signals[[i + 1L]], activation)
    }
    before <- signals[[i]]
    gradient[[2L * i - 1L]] <- if (slow) slopes %*% t(before) else tcrossprod(slopes, before)
    if (!is.null(layers[[i]]$bias)) gradient[[2L * i]] <- slopes %*% ones
    weights <- layers[[i]]$weights
    if (i > 1L) slopes <- if (slow) t(weights) %*% slopes else crossprod(weights, slopes)
  }
  unlist(gradient)
}

# Activations --------------------------------------------------------------------------

# The activation functions of a network's layers.

activations <- c("tanh", "logistic", "identity", "Gompertz", "ReLU", "leakyReLU")

layer_activations <- function(activation, sizes, call = rlang::caller_env()) {
  for (i in seq_along(activation)) {
    check_choice(
      activation[[i]], activations, arg = paste0("activation[", i, "]"), call = call
    )
  }
  layers <- length(sizes) - 1L
  abort_if(
    length(activation) != layers && length(activation) != 2L, "activation", activation, call,
    "`activation` must have 2 names (hidden layers, outputs) or one for each of the {layers}
     layers after the inputs, not {length(activation)}."
  )
  if (length(activation) != layers) {
    activation <- c(rep(activation[[1L]], layers - 1L), activation[[2L]])
  }
  activation
}

# The formulas are those of the package sigmoid.
activate <- function(x, activation) {
  switch(activation,
    tanh = tanh(x),
    logistic = stats::plogis(x),
    identity = x,
    Gompertz = exp(-exp(-x)),
    ReLU = {
      x[x < 0] <- 0
      x
    },
    leakyReLU = pmax(x, 0.01 * x)
  )
}

# The derivative of an activation as a function of its output.
activation_slope <- function(y, activation) {
  switch(activation,
    tanh = 1 - y * y,
    logistic = y * (1 - y),
    identity = 1,
    # For a very negative input the output is 0, which has no logarithm.
    Gompertz = -y * log(pmax(y, .Machine$double.xmin)),
    ReLU = y > 0,
    leakyReLU = ifelse(y > 0, 1, 0.01)
  )
}

# Scales bounded outputs to the range from 0 to 1.
unit_outputs <- function(outputs, activation) {
  if (activation == "tanh") (outputs + 1) / 2 else outputs
}

# Does a single output select the second of two actions? It does if it is above the middle of its
# range, or above 0 if it is unbounded. The middle itself selects the first action, because
# round(0.5) is 0.
above_half <- function(output, activation) {
  switch(activation,
    logistic = , Gompertz = output > 0.5,
    output > 0
  )
}
