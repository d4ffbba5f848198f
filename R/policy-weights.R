# The weights of a network: a matrix for each layer after the inputs, with a row for each neuron and
# a column for each of its inputs. The bias is an additional last column.

# The shapes of the matrices.
weight_shapes <- function(sizes, bias) {
  Map(c, sizes[-1L], sizes[-length(sizes)] + isTRUE(bias))
}

# Draws orthogonal rows (or columns, if these are fewer) of length `gain`, with biases of 0 (Saxe,
# McClelland and Ganguli 2014).
draw_orthogonal <- function(shape, gain, bias) {
  neurons <- shape[[1L]]
  inputs <- shape[[2L]] - isTRUE(bias)
  normal <- matrix(stats::rnorm(neurons * inputs), max(neurons, inputs))
  parts <- qr(normal, LAPACK = FALSE)
  signs <- sign(diag(as.matrix(qr.R(parts))))
  basis <- qr.Q(parts) * rep(signs, each = nrow(normal))
  cbind(gain * if (neurons >= inputs) basis else t(basis), if (isTRUE(bias)) numeric(neurons))
}

# Draws the weights in the order of the tutorial: first the matrix of the hidden layer, then the
# weights of the output.
draw_first_weights <- function(policy) {
  shapes <- weight_shapes(policy$sizes, policy$bias)
  if (policy$init == "orthogonal") {
    # With small weights, all actions are about equally likely at first. `NA` counts as an output
    # that draws, because the environment will choose softmax or gaussian.
    draws <- is.na(policy$output) || has_log_prob(policy)
    gain <- c(rep(sqrt(2), length(shapes) - 1L), if (draws) 0.01 else 1)
    return(Map(draw_orthogonal, shapes, gain, isTRUE(policy$bias)))
  }
  lapply(shapes, function(shape) {
    matrix(stats::runif(prod(shape), -1, 1), shape[[1L]], shape[[2L]])
  })
}

# Checks the weights, which the user may have changed. A network whose sizes depend on the
# environment has no weights before it is bound.
check_network <- function(policy, call = rlang::caller_env()) {
  abort_if(
    is.null(policy$weights),
    "policy", policy, call, "The network does not know its sizes: {sizes_text(policy$sizes)}.",
    i = "`policy_bind(policy, env)` takes them from the environment."
  )
  check_weights(policy$weights, policy$sizes, policy$bias, "policy$weights", call)
}

check_weights <- function(weights, sizes, bias = FALSE, name = "weights",
                          call = rlang::caller_env()) {
  wanted <- weight_shapes(sizes, bias)
  if (!is.list(weights) || length(weights) != length(wanted)) {
    shapes <- vapply(wanted, paste, "", collapse = " x ")
    must <- paste0("a list of ", length(wanted), " matrices (", paste(shapes, collapse = ", "), ")")
    abort_argument(weights, must, name, call)
  }
  for (i in seq_along(wanted)) {
    layer <- weights[[i]]
    shape <- as.integer(wanted[[i]])
    arg <- paste0(name, "[[", i, "]]")
    if (!is.matrix(layer) || !is.numeric(layer)) {
      abort_argument(layer, "a numeric matrix", arg, call)
    }
    abort_if(
      !identical(dim(layer), shape), arg, layer, call,
      '`{arg}` must be a matrix of {paste(shape, collapse = " x ")} for these
       sizes{if (isTRUE(bias)) " and a bias"}, not of {paste(dim(layer), collapse = " x ")}.',
      i = if (identical(rev(dim(layer)), shape)) {
        "`t()` transposes it: a row is a neuron, a column one of its inputs."
      }
    )
    if (anyNA(layer)) abort_argument(layer, "without missing values", arg, call)
  }
}

# The weights as one vector, layer after layer, each matrix column after column, and then the
# logarithms of standard deviations, if the policy has any.
weight_vector <- function(policy) {
  c(unlist(lapply(policy$weights, as.vector)), if (is_gaussian(policy)) policy$log_std)
}

with_weights <- function(policy, weights) {
  of_layers <- sum(lengths(policy$weights))
  policy$weights <- utils::relist(weights[seq_len(of_layers)], policy$weights)
  if (is_gaussian(policy)) policy$log_std <- weights[-seq_len(of_layers)]
  policy
}

count_weights <- function(policy) {
  sum(lengths(policy$weights)) + if (is_gaussian(policy)) length(policy$log_std) else 0L
}

# "4-2-1", with "*" for a size that depends on the environment.
sizes_text <- function(sizes) paste(ifelse(is.na(sizes), "*", sizes), collapse = "-")

# As numbers: coef() -------------------------------------------------------------------

#' Get and set the weights of a policy
#'
#' `coef()` returns the weights of a network as one numeric vector, and `coef(policy) <- w` sets
#' them. Use them to apply any function of vectors to policies: to average policies, to add noise to
#' one, or to call [stats::optim()].
#'
#' The order is that in which [policy_network()] draws them: layer after layer, each matrix column
#' after column, starting with the weights of the first input. A network with the output
#' `"gaussian"` has the logarithms of its standard deviations at the end, one for each output.
#'
#' @param object A network, made by [policy_network()] or found by a search; or candidates, made by
#'   [policy_candidates()].
#' @param ... Not used.
#' @param value The new weights, a numeric vector; for candidates a matrix as for
#'   [policy_candidates()].
#' @return `coef()` returns a numeric vector; for candidates a matrix with the weights of a
#'   candidate in each row. `coef<-` returns the policy with the new weights.
#' @section Errors: `gym_error_argument` for a policy without weights, a wrong number of weights or
#'   missing values.
#' @export
#' @examples
#' policy <- policy_network(c(4, 2, 1))
#' coef(policy)
#' coef(policy)[1]
#' policy$weights[[1]][1, 1]
#'
#' # Noise around a policy.
#' near <- policy
#' coef(near) <- coef(policy) + rnorm(10, sd = 0.1)
coef.gym_policy_network <- function(object, ...) {
  check_dots_empty(...)
  check_network(object)
  weight_vector(object)
}

#' @rdname coef.gym_policy_network
#' @export
coef.gym_policy_candidates <- function(object, ...) {
  check_dots_empty(...)
  object$weights
}

#' @export
coef.gym_policy <- function(object, ...) abort_no_weights(object, "object", rlang::current_env())

#' @rdname coef.gym_policy_network
#' @export
`coef<-` <- function(object, ..., value) UseMethod("coef<-")

#' @export
`coef<-.default` <- function(object, ..., value) {
  abort_no_weights(object, "object", rlang::current_env())
}

#' @export
`coef<-.gym_policy_network` <- function(object, ..., value) {
  check_dots_empty(...)
  check_network(object)
  count <- count_weights(object)
  value <- plain_numbers(value)
  if (!is.numeric(value) || length(value) != count) {
    abort_argument(value, paste("a vector of", count_of(count, "number")), "value",
                   rlang::current_env())
  }
  if (anyNA(value)) {
    abort_argument(value, "without missing values", "value", rlang::current_env())
  }
  with_weights(object, as.numeric(value))
}

#' @export
`coef<-.gym_policy_candidates` <- function(object, ..., value) {
  check_dots_empty(...)
  policy_candidates(object$policy, value)
}

# A table has no weights. Its values are in the training that learned them.
table_hint <- paste(
  "`decision_map(env, policy)` shows what a table does, and `state_values(training)` the values",
  "that were learned; both can be plotted."
)

abort_no_weights <- function(policy, arg, call) {
  abort_wrong(
    arg, policy, call, "`{arg}` must be a policy with weights, not {policy_text(policy)}.",
    i = if (inherits(policy, "gym_policy_table")) table_hint else "`policy_network()` makes one."
  )
}

# Linear policies ----------------------------------------------------------------------

#' Act by weighted sums of the observation
#'
#' Make a network without hidden neurons, whose outputs are weighted sums of the observation's
#' numbers. That is enough for many environments, including MuJoCo's robots (Mania, Guy and Recht
#' 2018; Rajeswaran et al. 2017). The environment determines the numbers of inputs and outputs. All
#' weights are 0 until a search finds others.
#'
#' The outputs determine the action in the same way as unbounded outputs of [policy_network()]. With
#' several actions, the policy takes the one with the largest output. With two actions and one
#' output, it takes the second if the output is above 0. For a Box, the outputs are the numbers of
#' the action, cut at its bounds.
#'
#' @inheritParams policy_network
#' @param weights A matrix with one row for each output and one column for each number of an
#'   observation, and one more column for the constant with `bias = TRUE`. `NULL`, the default, sets
#'   all weights to 0.
#' @return A policy of class `gym_policy_network`, see [policy_network()], with the activation
#'   `"identity"`. Unless you give weights, its sizes are `NA` and its `weights` `NULL` until it is
#'   played.
#' @section Errors: `gym_error_argument` if `weights` is not a numeric matrix or has missing values.
#' @references H. Mania, A. Guy and B. Recht (2018), Simple random search of static linear policies
#'   is competitive for reinforcement learning, NeurIPS 31.
#'
#'   A. Rajeswaran, K. Lowrey, E. Todorov and S. Kakade (2017), Towards generalization and
#'   simplicity in continuous control, NeurIPS 30.
#' @seealso [policy_network()]
#' @export
#' @examples
#' policy_linear()
#' follow <- policy_linear(weights = rbind(c(0, 0, 1, 1)))
#' act(follow, rbind(c(0, 0, 0.1, 0), c(0, 0, -0.1, 0)))
policy_linear <- function(bias = FALSE, normalize = FALSE, weights = NULL, clip_obs = 10) {
  check_flag(bias)
  check_flag(normalize)
  check_above_zero(clip_obs, max = Inf)
  sizes <- c(NA_integer_, NA_integer_)
  weights <- plain_numbers(weights)
  if (!is.null(weights)) {
    if (!is.matrix(weights) || !is.numeric(weights) || !nrow(weights) || ncol(weights) <= bias) {
      abort_argument(weights, "a numeric matrix", "weights", rlang::current_env())
    }
    sizes <- c(ncol(weights) - bias, nrow(weights))
    check_weights(list(weights), sizes, bias)
  }
  policy <- new_network(as.integer(sizes), "identity", bias, normalize)
  policy$clip_obs <- clip_obs
  policy["weights"] <- list(if (!is.null(weights)) list(weights))
  policy
}
