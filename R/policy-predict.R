#' @rdname act
#' @param object A policy made by [policy_network()] or [as_policy()].
#' @param newdata Observations, as for `observation`.
#' @param type `"action"`, the default, returns the policy's actions, or the most likely ones if it
#'   draws them. `"output"` returns the outputs of the network, or the predictions of the model.
#'   `"probability"` returns the probability of each action, for a network with the output
#'   `"softmax"` or `"epsilon-greedy"`, or a table.
#' @export
predict.gym_policy <- function(object, newdata, type = c("action", "output", "probability"), ...) {
  type <- check_choice(type[1L], c("action", "output", "probability"), arg = "type")
  predict_policy(object, newdata, type)
}

predict_policy <- function(policy, newdata, type, call = rlang::caller_env()) {
  UseMethod("predict_policy")
}

#' @exportS3Method
predict_policy.default <- function(policy, newdata, type, call = rlang::caller_env()) {
  gym_abort(
    c(paste0("`predict()` needs the policy to be a network, a table or a model, not ",
             policy_text(policy), "."),
      i = if (inherits(policy, "gym_policy_memory")) {
        "`act(policy, observation, memory)` asks it by hand."
      }),
    class = "gym_error_argument", argument = "object", value = policy, call = call
  )
}

#' @exportS3Method
predict_policy.gym_policy_network <- function(policy, newdata, type, call = rlang::caller_env()) {
  check_network(policy, call)
  rows <- network_rows(policy, newdata, "newdata", call)
  if (type == "action") {
    return(rows_action(policy, rows, draw = FALSE, call))
  }
  outputs <- network_outputs(policy, rows$values, call)
  if (type == "probability") {
    return(output_probabilities(policy, outputs, call))
  }
  if (ncol(outputs) == 1L) outputs[, 1L] else outputs
}

# The probability of each action, a row for each row of outputs.
output_probabilities <- function(policy, outputs, call) {
  if (identical(policy$output, "softmax")) {
    return(softmax_rows(outputs))
  }
  if (!identical(policy$output, "epsilon-greedy")) {
    abort_no_probabilities(policy, call)
  }
  n <- policy$action_space$n %||% max(ncol(outputs), 2L)
  p <- matrix(policy$epsilon / n, nrow(outputs), n)
  best <- cbind(seq_len(nrow(outputs)), discrete_action(NULL, outputs, greedy_policy(policy)) + 1L)
  p[best] <- p[best] + 1 - policy$epsilon
  p
}

abort_no_probabilities <- function(policy, call) {
  gym_abort(
    c(paste0("Only a policy that draws one of several actions has their probabilities, not ",
             policy_text(policy), "."),
      i = "`policy_network(output = \"softmax\")` makes one."),
    class = "gym_error_argument", argument = "type", value = "probability", call = call
  )
}
