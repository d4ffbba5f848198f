#' Make candidates from a matrix of weights
#'
#' Make several networks with the same sizes and activations but different weights. [rollout()] and
#' [evaluate_policy()] play such candidates together, which is much faster than one after the other.
#'
#' @param policy A network, made by [policy_network()], with the sizes and activations of all
#'   candidates. Its own weights are ignored.
#' @param weights A numeric matrix with the weights of a candidate in each row, in the order of
#'   [coef()][coef.gym_policy_network]. Row names are the candidates' names.
#' @return An object of class `gym_policy_candidates`, a list with the elements `policy` and
#'   `weights`. [coef()][coef.gym_policy_network] returns the matrix.
#' @section Errors: `gym_error_argument` if `policy` is not a network, or if `weights` is not a
#'   matrix without missing values with a column for each of the network's weights.
#' @export
#' @examples
#' policy <- policy_network(c(4, 1))
#' candidates <- policy_candidates(policy, rbind(left = c(0, 0, -1, 0), right = c(0, 0, 1, 0)))
#' candidates
#' coef(candidates)["right", ]
#'
#' @examplesIf gym:::can_start_server()
#' rollout("CartPole-v1", candidates, episodes = 5, seed = 1)
policy_candidates <- function(policy, weights) {
  check_is_network(policy)
  check_network(policy)
  weights <- plain_numbers(weights)
  call <- rlang::current_env()
  if (!is.matrix(weights) || !is.numeric(weights) || !nrow(weights)) {
    single <- is.numeric(weights) && is.null(dim(weights))
    abort_wrong(
      "weights", weights, call,
      "`weights` must be a numeric matrix with a candidate in each row, not
       {describe_argument(weights)}.",
      i = if (single) "For a single candidate this is `rbind(weights)`."
    )
  }
  count <- count_weights(policy)
  abort_if(
    ncol(weights) != count, "weights", weights, call,
    '`weights` must have the {count_of(count, "weight")} of a candidate in each row, one a
     column, not {count_of(ncol(weights), "column")}.',
    i = if (nrow(weights) == count) "`t(weights)` has a candidate in each row."
  )
  if (anyNA(weights)) abort_argument(weights, "without missing values", "weights", call)
  storage.mode(weights) <- "double"
  new_candidates(policy, weights)
}

#' @export
format.gym_policy_candidates <- function(x, ...) {
  paste0(count_of(nrow(x$weights), "candidate"), " of ", format(x$policy))
}

# Several policies that play side by side ----------------------------------------------

#' Get the policy of some candidates
#'
#' @param candidates Their numbers, in increasing order.
#' @return A policy with only these candidates. For a single candidate, its own policy.
#' @noRd
policy_subset <- function(policy, candidates) UseMethod("policy_subset")

#' @exportS3Method
policy_subset.default <- function(policy, candidates) policy

#' @exportS3Method
policy_subset.gym_policy_candidates <- function(policy, candidates) {
  policy$weights <- policy$weights[candidates, , drop = FALSE]
  if (nrow(policy$weights) == 1L) {
    with_weights(policy$policy, policy$weights[1L, ])
  } else {
    policy
  }
}

#' @exportS3Method
policy_subset.gym_policy_list <- function(policy, candidates) {
  policies <- unclass(policy)[candidates]
  if (length(policies) == 1L) policies[[1L]] else policy_list(policies)
}

#' Get the policy that acts for rows of observations
#'
#' @param candidate The candidate that acts for each row.
#' @param sub_env The sub-environment of each row.
#' @return A policy for [act_batch()].
#' @noRd
policy_rows <- function(policy, candidate, sub_env) UseMethod("policy_rows")

#' @exportS3Method
policy_rows.default <- function(policy, candidate, sub_env) policy

# The number of candidates, or `NULL` for a single policy.
count_candidates <- function(policy) {
  if (inherits(policy, "gym_policy_candidates")) {
    nrow(policy$weights)
  } else if (inherits(policy, "gym_policy_list")) {
    length(policy)
  }
}

# The candidates' names, which must be unique, or `NULL`.
candidate_names <- function(policy) {
  names <- if (inherits(policy, "gym_policy_candidates")) {
    rownames(policy$weights)
  } else if (inherits(policy, "gym_policy_list")) {
    names(policy)
  }
  if (length(names) && all(nzchar(names)) && !anyDuplicated(names)) names
}

# Networks with weights of their own ----------------------------------------------------

new_candidates <- function(policy, weights) {
  structure(
    list(policy = policy, weights = weights), class = c("gym_policy_candidates", "gym_policy")
  )
}

#' @exportS3Method
policy_bind.gym_policy_candidates <- function(policy, env, call = rlang::caller_env()) {
  policy$policy <- policy_bind(policy$policy, env, call)
  policy
}

#' @exportS3Method
policy_rows.gym_policy_candidates <- function(policy, candidate, sub_env) {
  network <- policy$policy
  ends <- cumsum(lengths(network$weights))
  layers <- Map(
    function(from, to) policy$weights[candidate, from:to, drop = FALSE],
    c(0L, ends[-length(ends)]) + 1L, ends
  )
  if (is_gaussian(network)) network$log_std <- policy$weights[candidate, -seq_len(max(ends))]
  structure(list(network = network, layers = layers), class = c("gym_policy_rows", "gym_policy"))
}

#' @exportS3Method
act_batch.gym_policy_rows <- function(policy, observation, n, vector_env) {
  network <- policy$network
  signal <- network_inputs(network, number_rows(observation))
  for (layer in seq_along(policy$layers)) {
    signal <- with_bias(signal, network)
    signal <- activate(sum_weighted(signal, policy$layers[[layer]]), network$activation[[layer]])
  }
  network_action(network$action_space, signal, network, one = FALSE)
}

#' Sum inputs with different weights for each row
#'
#' @param weights In each row the weight matrix of a layer, column after column: all outputs of the
#'   first input, then those of the next.
#' @return A matrix with one column for each output.
#' @noRd
sum_weighted <- function(signal, weights) {
  n <- nrow(signal)
  inputs <- ncol(signal)
  outputs <- ncol(weights) %/% inputs
  terms <- signal[, rep(seq_len(inputs), each = outputs)] * weights
  sums <- .rowSums(terms, n * outputs, inputs)
  dim(sums) <- c(n, outputs)
  sums
}

# Lists --------------------------------------------------------------------------------

policy_list <- function(policies) {
  structure(policies, class = c("gym_policy_list", "gym_policy"))
}

#' @exportS3Method
policy_bind.gym_policy_list <- function(policy, env, call = rlang::caller_env()) {
  policy_list(lapply(unclass(policy), policy_bind, env = env, call = call))
}

#' @export
format.gym_policy_list <- function(x, ...) {
  few <- unclass(x)[seq_len(min(length(x), 4L))]
  texts <- vapply(few, policy_label, "")
  if (!is.null(candidate_names(x))) {
    texts <- paste0(names(few), ifelse(names(few) == texts, "", paste0(" (", texts, ")")))
  }
  more <- if (length(x) > 4L) paste("and", length(x) - 4L, "more")
  noun <- if (length(x) == 1L) " policy: " else " policies: "
  paste0(length(x), noun, paste(c(texts, more), collapse = "; "))
}

#' @exportS3Method
policy_rows.gym_policy_list <- function(policy, candidate, sub_env) {
  rows <- split(seq_along(candidate), candidate)
  policies <- Map(
    function(own, rows) policy_rows(own, candidate[rows], sub_env[rows]),
    unclass(policy)[as.integer(names(rows))], rows
  )
  structure(
    list(policies = policies, rows = rows), class = c("gym_policy_list_rows", "gym_policy")
  )
}

#' @exportS3Method
act_batch.gym_policy_list_rows <- function(policy, observation, n, vector_env) {
  observed <- vector_env$observation_space
  actions <- Map(
    function(policy, rows) {
      own <- batch_rows(observed, observation, rows)
      act_batch(policy, own, length(rows), vector_env)
    },
    policy$policies, policy$rows
  )
  together <- bind_batches(vector_env$action_space, actions)
  batch_rows(vector_env$action_space, together, order(unlist(policy$rows)))
}
