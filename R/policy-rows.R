# Candidates: networks of the same sizes with different weights, which play in the same batch.

#' Make one policy of several candidates
#'
#' @param policies A list of networks that differ only in their weights.
#' @param candidate For each sub-environment the place in the list of the network that plays there.
#' @return A policy for [act_batch()]: the network itself where there is only one.
#' @noRd
candidates_of <- function(policies, candidate) {
  if (length(policies) == 1L) {
    return(policies[[1L]])
  }
  layers <- lapply(seq_along(policies[[1L]]$weights), function(layer) {
    rows <- lapply(policies, function(policy) as.vector(policy$weights[[layer]]))
    do.call(rbind, rows)[candidate, , drop = FALSE]
  })
  structure(
    list(policy = policies[[1L]], layers = layers),
    class = c("gym_policy_rows", "gym_policy")
  )
}

#' @exportS3Method
act_batch.gym_policy_rows <- function(policy, observation, playing, vector_env) {
  network <- policy$policy
  signal <- network_inputs(network$observation_space, number_rows(observation))
  all_play <- length(playing) == nrow(policy$layers[[1L]])
  for (layer in seq_along(policy$layers)) {
    weights <- policy$layers[[layer]]
    if (!all_play) {
      weights <- weights[playing, , drop = FALSE]
    }
    signal <- activate(sum_weighted(signal, weights), network$activation[[layer]])
  }
  network_action(network$action_space, signal, network, one = FALSE)
}

#' Sum inputs with weights of their own for each row
#'
#' @param weights In each row the weight matrix of a layer, column after column: all
#'   outputs of the first input, then those of the next.
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
