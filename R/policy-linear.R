#' Act by weighted sums of the observation
#'
#' Make a network without hidden neurons, whose outputs are weighted sums of the observation's
#' numbers. That is enough for many environments, including MuJoCo's robots (Mania, Guy and Recht
#' 2018; Rajeswaran et al. 2017). The environment determines the numbers of inputs and outputs. All
#' weights are 0 until a search finds others.
#'
#' The outputs determine the action as for unbounded outputs of [policy_network()]. With several
#' actions it takes the one with the largest output. With two actions and one output it takes the
#' second if the output is above 0. The numbers of a Box are the outputs, cut at its bounds.
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
