#' Get and set the weights of a policy
#'
#' `coef()` returns the weights of a network as one numeric vector, and `coef(policy) <- w` sets
#' them. Use it to apply any function of vectors to policies: averages of policies, noise around
#' one, [stats::optim()].
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

# A table is a picture of states, and what it holds belongs to the agent that learned it.
table_hint <- paste(
  "`decision_map(env, policy)` shows what a table does, and `state_values(training)` the values",
  "that were learned; both can be plotted."
)

abort_no_weights <- function(policy, arg, call) {
  gym_abort(
    c(paste0("`", arg, "` must be a policy with weights, not ", policy_text(policy), "."),
      i = if (inherits(policy, "gym_policy_table")) {
        table_hint
      } else {
        "`policy_network()` makes one."
      }),
    class = "gym_error_argument", argument = arg, value = policy, call = call
  )
}
