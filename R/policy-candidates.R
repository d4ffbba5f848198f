#' Make candidates of a matrix of weights
#'
#' Candidates are networks of the same sizes and activations that differ in their weights.
#' [rollout()] and [evaluate_policy()] play all of them at once, which is much faster than playing
#' one after the other.
#'
#' @param policy A network, made by [policy_network()]: its sizes and activations are those of all
#'   candidates. Its own weights are not used.
#' @param weights A numeric matrix with the weights of a candidate in each row, in the order of
#'   [coef()][coef.gym_policy_network]. Names of rows are the candidates' names.
#' @return An object of class `gym_policy_candidates`, a list with the elements `policy` and
#'   `weights`. [coef()][coef.gym_policy_network] gives the matrix.
#' @section Errors: `gym_error_argument` when `policy` is no network, or `weights` not a matrix of
#'   as many columns as the network has weights, without missing values.
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
  if (!inherits(policy, "gym_policy_network")) {
    abort_no_weights(policy, "policy", rlang::current_env())
  }
  check_network(policy)
  weights <- plain_numbers(weights)
  check_candidate_weights(weights, sum(lengths(policy$weights)))
  storage.mode(weights) <- "double"
  new_candidates(policy, weights)
}

check_candidate_weights <- function(weights, count, call = rlang::caller_env()) {
  if (!is.matrix(weights) || !is.numeric(weights) || !nrow(weights)) {
    single <- is.numeric(weights) && is.null(dim(weights))
    gym_abort(
      c(paste0("`weights` must be a numeric matrix with a candidate in each row, not ",
               describe_argument(weights), "."),
        i = if (single) "For a single candidate this is `rbind(weights)`."),
      class = "gym_error_argument", argument = "weights", value = weights, call = call
    )
  }
  if (ncol(weights) != count) {
    turned <- nrow(weights) == count
    gym_abort(
      c(paste0("`weights` must have the ", count_of(count, "weight"), " of a candidate in each ",
               "row, one a column, not ", count_of(ncol(weights), "column"), "."),
        i = if (turned) "`t(weights)` has a candidate in each row."),
      class = "gym_error_argument", argument = "weights", value = weights, call = call
    )
  }
  if (anyNA(weights)) {
    abort_argument(weights, "without missing values", "weights", call)
  }
}

#' @export
format.gym_policy_candidates <- function(x, ...) {
  paste0(count_of(nrow(x$weights), "candidate"), " of ", format(x$policy))
}
