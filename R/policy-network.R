#' Act by a small neural network
#'
#' Make a policy from a small neural network. Each layer multiplies its input by its weights and
#' applies its activation. The weights are drawn by R's generator, by default uniformly between -1
#' and 1.
#'
#' # From outputs to an action
#'
#' The meaning of the outputs depends on the environment's action space. [rollout()],
#' [search_random()] and [policy_bind()] tell the policy this space. Until then it assumes the
#' actions 0, 1, ...
#'
#' - One output and two actions: the output, scaled to the range from 0 to 1, is rounded, as in the
#'   tutorial *Artificial Intelligence in R (I)* (2018). Exactly one half selects the first action,
#'   as [round()] returns 0.
#' - As many outputs as actions: the action with the largest output, or the first of equal ones. The
#'   first output always belongs to the first action, even if its number is not 0.
#' - A Box with as many numbers as there are outputs: each output is stretched from its own range to
#'   the bounds of its number. `"tanh"` at -1 gives the lower bound, at 0 the middle and at 1 the
#'   upper bound. (Numbers of an integer Box are rounded.) A Box with an unbounded side has no such
#'   scale and is refused.
#'
#' The range of `"logistic"` and `"Gompertz"` is from 0 to 1, that of `"tanh"` from -1 to 1.
#' `"identity"`, `"ReLU"` and `"leakyReLU"` are unbounded. For these, a single output selects the
#' second of two actions if it is above 0, and the outputs are the numbers of a Box, cut at its
#' bounds.
#'
#' Such a policy is greedy: the same observation gives the same action. Other policies draw their
#' actions. Their last activation is `"identity"`:
#'
#' - `output = "softmax"` draws an action of a Discrete space with a probability proportional to
#'   `exp(output)`. The network has an output for each action.
#' - `output = "gaussian"` draws the numbers of a Box, each from a normal distribution around its
#'   output. The standard deviations do not depend on the observation. Their logarithms, `log_std`,
#'   are weights, the last ones of [coef()][coef.gym_policy_network]. The step cuts the numbers at
#'   the bounds of the Box, but the steps of a [rollout()] keep the numbers as drawn, because
#'   [policy_log_prob()] needs these.
#' - `output = "epsilon-greedy"` draws any action with the probability `epsilon`, and otherwise
#'   takes the one with the largest output.
#'
#' # Observations
#'
#' For a Box, the network has an input for each number of an observation (an array is flattened row
#' by row, as by Gymnasium). For a Discrete observation, such as the field of a board, it has an
#' input for each possible value: 1 for the observed value, 0 for the others.
#'
#' With `normalize = TRUE` the policy subtracts the mean of each number of a Box and divides by its
#' standard deviation, so that large and small numbers have the same influence. The policy keeps
#' these moments, which are those of the observations in training. A search updates them; playing
#' and evaluating do not. Before the first update, observations are used as they are. A number that
#' has never changed becomes 0. The result is clipped to the range from `-clip_obs` to `clip_obs`,
#' as in
#' [Stable-Baselines3](https://stable-baselines3.readthedocs.io/en/master/guide/vec_envs.html).
#'
#' @param sizes The numbers of inputs, of neurons in each hidden layer, and of outputs: whole
#'   numbers, at least two of them. The default, `c(4, 2, 1)`, is the network of the tutorial, which
#'   has 10 weights (4 x 2 + 2 x 1). The first and the last may be `NA`. The environment then
#'   determines them; for two actions there is a single output. In this case the weights are drawn
#'   when the policy is first played, from a seed that is drawn now.
#' @param activation The names of the activations: one for the hidden layers and one for the outputs
#'   (the default, `c("tanh", "logistic")`, as in the tutorial), or one for each layer after the
#'   inputs: `"tanh"`, `"logistic"`, `"identity"` (no change), `"Gompertz"`, `"ReLU"` or
#'   `"leakyReLU"`. If the output is not `"greedy"` the default is `c("tanh", "identity")`.
#' @param weights The weights: a list of matrices, one for each layer after the inputs, with one row
#'   for each neuron of the layer and one column for each of the previous layer. With `bias = TRUE`
#'   the last column is the bias. `NULL`, the default, draws them.
#' @param bias Does each neuron have a bias, a number added to its sum? `FALSE`, the default, or
#'   `TRUE`.
#' @param normalize Normalise observations? `FALSE`, the default, or `TRUE`; see the section
#'   *Observations* of [policy_network()].
#' @param clip_obs Where to clip normalised observations, a number above 0 or `Inf`. The default
#'   is 10.
#' @param output How the outputs determine an action, a string: `"greedy"`, the default,
#'   `"softmax"`, `"gaussian"` or `"epsilon-greedy"`, see below. `NA` depends on the environment:
#'   softmax for a Discrete action space, gaussian for a Box.
#' @param log_std The natural logarithm of the first standard deviations of `"gaussian"`, a number,
#'   or one for each output. The default is 0, a standard deviation of 1.
#' @param epsilon The probability of a random action with `"epsilon-greedy"`, a number from 0 to 1.
#'   The default is 0.1.
#' @param init How to draw the first weights, a string. `"uniform"`, the default, draws them between
#'   -1 and 1. `"orthogonal"` makes layers whose rows (or columns, if these are fewer) are
#'   orthogonal. Their length is sqrt(2). For the outputs it is 1, or 0.01 if actions are drawn by
#'   their probability. Biases are 0 (Saxe, McClelland and Ganguli 2014; Andrychowicz et al. 2021).
#' @return A policy of class `gym_policy_network`, for [act()], [rollout()] and [search_random()].
#'   It is a list with the elements `sizes` (integers), `activation` (strings, one for each layer),
#'   `weights` (a list of matrices), `bias` (a logical), `moments` (`NULL`, or a list of `count`,
#'   `mean`, `squares` and `scale`, of the observations), `clip_obs` (a number), `output` and `init`
#'   (strings), `log_std` (numbers, which only `"gaussian"` uses), `epsilon` (a number),
#'   `observation_space`, `action_space` (spaces) and `env_id` (the id of the environment, a
#'   string), all three `NULL` until the policy is played.
#' @section Errors: `gym_error_argument` if sizes, activations and weights do not fit each other,
#'   and from [act()] if an observation does not have a number for each input.
#' @references The network and the way its weights are drawn are those of the tutorial,
#'   whose code computes the activations with the package sigmoid.
#'
#'   A. M. Saxe, J. L. McClelland and S. Ganguli (2014), Exact solutions to the nonlinear dynamics
#'   of learning in deep linear neural networks, ICLR.
#'
#'   M. Andrychowicz et al. (2021), What matters for on-policy deep actor-critic methods? A
#'   large-scale study, ICLR.
#' @seealso [plot()][plot.gym_policy_network()] draws a network, [decision_map()] shows its actions;
#'   [policy_random()].
#' @export
#' @examples
#' set.seed(1)
#' policy <- policy_network(sizes = c(4, 2, 1))
#' policy
#' policy$weights
#' act(policy, c(0.01, -0.2, 0.03, 0.4))
#'
#' # You can also give the weights. This network follows the pole.
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 1), nrow = 1)))
#' act(follow, rbind(c(0, 0, 0.1, 0), c(0, 0, -0.1, 0)))
policy_network <- function(sizes = c(4, 2, 1), activation = NULL, weights = NULL, bias = FALSE,
                           normalize = FALSE, output = "greedy", log_std = 0, epsilon = 0.1,
                           init = "uniform", clip_obs = 10) {
  sizes <- check_sizes(sizes)
  check_flag(bias)
  check_flag(normalize)
  check_above_zero(clip_obs, max = Inf)
  output <- if (isTRUE(is.na(output))) {
    NA_character_
  } else {
    check_choice(output, c("greedy", "softmax", "gaussian", "epsilon-greedy"))
  }
  last <- if (identical(output, "greedy")) "logistic" else "identity"
  activation <- layer_activations(activation %||% c("tanh", last), sizes)
  last <- activation[[length(activation)]]
  call <- rlang::current_env()
  abort_if(
    !identical(output, "greedy") && last != "identity",
    "activation", activation, call,
    'A network that draws its actions needs outputs of "identity", not of "{last}".',
    i = '`activation = c("tanh", "identity")` has them.'
  )
  check_number(epsilon, min = 0, max = 1)
  policy <- new_network(sizes, activation, bias, normalize)
  policy$clip_obs <- clip_obs
  policy$output <- output
  log_std <- plain_numbers(log_std)
  if (!is.numeric(log_std) || !length(log_std) || !all(is.finite(log_std))) {
    must <- "a finite number, or one for each output"
    abort_argument(log_std, must, "log_std", call)
  }
  policy$log_std <- as.numeric(log_std)
  policy$epsilon <- epsilon
  policy$init <- check_choice(init, c("uniform", "orthogonal"))
  if (!anyNA(sizes)) policy <- with_deviations(policy)
  weights <- plain_numbers(weights)
  if (!is.null(weights)) {
    abort_if(
      anyNA(sizes), "sizes", sizes, call,
      "`weights` are for given sizes, and `sizes` leaves some to the environment.",
      i = "Give all sizes as numbers."
    )
    check_weights(weights, sizes, bias)
    policy$weights <- weights
    policy
  } else {
    policy_resample(policy)
  }
}

new_network <- function(sizes, activation, bias, normalize) {
  structure(
    list(
      sizes = sizes,
      activation = activation,
      weights = NULL,
      bias = bias,
      moments = if (normalize) no_moments(),
      clip_obs = 10,
      output = "greedy",
      log_std = 0,
      epsilon = 0,
      init = "uniform",
      observation_space = NULL,
      action_space = NULL,
      env_id = NULL
    ),
    class = c("gym_policy_network", "gym_policy")
  )
}

# One standard deviation for each output.
with_deviations <- function(policy, call = rlang::caller_env()) {
  outputs <- policy$sizes[[length(policy$sizes)]]
  if (!length(policy$log_std) %in% c(1L, outputs)) {
    must <- paste("one number, or one for each of", count_of(outputs, "output"))
    abort_argument(policy$log_std, must, "log_std", call)
  }
  policy$log_std <- rep_len(policy$log_std, outputs)
  policy
}

# The first and the last may be `NA`: the environment then determines them.
check_sizes <- function(sizes, call = rlang::caller_env()) {
  if (is.logical(sizes) && all(is.na(sizes))) {
    sizes <- as.integer(sizes)
  }
  sizes <- plain_numbers(sizes, call = call)
  if (!is.numeric(sizes) || length(sizes) < 2L) {
    abort_argument(sizes, "two or more whole numbers", "sizes", call)
  }
  for (i in seq_along(sizes)) {
    if (!(is.na(sizes[[i]]) && i %in% c(1L, length(sizes)))) {
      check_count(sizes[[i]], arg = paste0("sizes[", i, "]"), call = call)
    }
  }
  as.integer(sizes)
}

# From an observation to an action -------------------------------------------------

#' @rdname act
#' @export
act.gym_policy_network <- function(policy, observation, draw = TRUE, ...) {
  check_network(policy)
  check_flag(draw)
  call <- rlang::current_env()
  rows_action(policy, network_rows(policy, observation, "observation", call), draw, call)
}

# Reads observations that a user gave, as observation_rows() does, and computes their actions.
network_rows <- function(policy, observation, arg, call) {
  observation_rows(observation, policy$observation_space, policy$sizes[[1L]], arg, call)
}

rows_action <- function(policy, rows, draw, call) {
  # Without an environment, the outputs choose one of several actions. Outputs of "logistic", the
  # default, are made for that. The user may mean other outputs as the numbers of a Box, so say it.
  if (is.null(policy$action_space) && policy$output %in% c("greedy", NA) &&
        output_activation(policy) != "logistic") {
    last <- max(policy$sizes[[length(policy$sizes)]], 2L) - 1L
    rlang::inform(
      c(paste0("The network knows no environment and takes actions from 0 to ", last, "."),
        i = "`policy_bind(policy, env)` gives it those of `env`, such as the numbers of a Box."),
      class = "gym_message_unbound", .frequency = "once", .frequency_id = "gym_unbound"
    )
  }
  if (!draw) policy <- greedy_policy(policy)
  outputs <- network_outputs(policy, rows$values, call)
  network_action(policy$action_space, outputs, policy, rows$one)
}

#' @exportS3Method
act_batch.gym_policy_network <- function(policy, observation, n, vector_env) {
  outputs <- network_outputs(policy, number_rows(observation))
  network_action(policy$action_space, outputs, policy, one = FALSE)
}

# R keeps an observation with several dimensions column after column. Reordering the input weights
# once saves reordering every observation.
#' @exportS3Method
policy_rows.gym_policy_network <- function(policy, candidate, sub_env) {
  shape <- policy$observation_space$shape
  if (length(shape) > 1L && prod(shape) == policy$sizes[[1L]]) {
    by_row <- aperm(array(seq_len(prod(shape)), rev(shape)))
    bias <- if (isTRUE(policy$bias)) policy$sizes[[1L]] + 1L
    policy$weights[[1L]] <- policy$weights[[1L]][, c(by_row, bias), drop = FALSE]
    policy$moments <- reorder_moments(policy$moments, by_row)
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
  signal <- network_inputs(policy, values, call)
  # Some activations turn a matrix without rows into a vector.
  if (!nrow(signal)) {
    return(matrix(0, 0L, policy$sizes[[length(policy$sizes)]]))
  }
  for (layer in seq_along(policy$weights)) {
    signal <- with_bias(signal, policy)
    signal <- activate(tcrossprod(signal, policy$weights[[layer]]), policy$activation[[layer]])
  }
  signal
}

# The input of a layer. With a bias, the constant 1 is one more input.
with_bias <- function(signal, policy) if (isTRUE(policy$bias)) cbind(signal, 1) else signal

network_inputs <- function(policy, values, call = rlang::caller_env()) {
  values <- plain_numbers(values, "observation", call)
  space <- policy$observation_space
  if (!inherits(space, "gym_space_discrete")) {
    if (ncol(values) != policy$sizes[[1L]] || !is.numeric(values)) {
      given <- if (is.numeric(values)) {
        paste("has", count_of(ncol(values), "number"))
      } else {
        paste("is of type", typeof(values))
      }
      abort_wrong(
        "observation", values, call,
        'The network takes {count_of(policy$sizes[[1L]], "input")}, but the observation {given}.'
      )
    }
    return(normalized(values, policy$moments, policy$clip_obs))
  }
  at <- counted_from_one(as.vector(values), space$start, space$n, "observation", call)
  inputs <- matrix(0, nrow = nrow(values), ncol = space$n)
  inputs[cbind(seq_len(nrow(values)), at)] <- 1
  inputs
}

# Numbers values from 1 that the space numbers from `start`.
counted_from_one <- function(values, start, n, arg, call) {
  at <- if (is.numeric(values)) values - start + 1 else NA
  if (anyNA(at) || any(at < 1 | at > n | at != trunc(at))) {
    must <- paste("whole numbers from", start, "to", start + n - 1L)
    abort_argument(values, must, arg, call)
  }
  as.integer(at)
}

# Drawing again, and printing ------------------------------------------------------

# Draws a network's weights again.
policy_resample <- function(policy) {
  if (anyNA(policy$sizes)) {
    # The weights are drawn from this seed once the sizes are known.
    policy$weights_seed <- draw_seed()
  } else {
    policy$weights <- draw_first_weights(policy)
  }
  policy
}

#' @export
format.gym_policy_network <- function(x, ...) {
  weights <- if (!is.null(x$weights)) count_of(count_weights(x), "weight")
  output <- if (!identical(x$output, "greedy")) {
    c(x$output, if (identical(x$output, "epsilon-greedy")) paste("epsilon", number_text(x$epsilon)))
  }
  paste(
    c(
      paste("network", sizes_text(x$sizes)), x$activation, if (isTRUE(x$bias)) "bias",
      if (!is.null(x$moments)) "normalized observations", output[!is.na(output)], weights
    ),
    collapse = ", "
  )
}
