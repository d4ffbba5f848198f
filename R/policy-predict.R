#' @rdname act
#' @param object A policy made by [policy_network()] or [as_policy()].
#' @param newdata Observations: a numeric vector for a single one, a matrix with one in each row, or
#'   a data frame, such as the steps of a [rollout()], with a column for each number of an
#'   observation under its name there.
#' @param type `"action"`, the default, for the policy's actions, or `"output"` for the outputs of
#'   the network, or the predictions of the model, that they follow from.
#' @export
predict.gym_policy <- function(object, newdata, type = c("action", "output"), ...) {
  type <- check_choice(type[1L], c("action", "output"), arg = "type")
  predict_policy(object, newdata, type)
}

predict_policy <- function(policy, newdata, type, call = rlang::caller_env()) {
  if (inherits(policy, "gym_policy_model")) {
    return(predict_model(policy, newdata, type, call))
  }
  if (inherits(policy, c("gym_policy_table", "gym_policy_features"))) {
    return(predict_values(policy, newdata, type))
  }
  if (!inherits(policy, "gym_policy_network")) {
    gym_abort(
      paste0("`predict()` needs the policy to be a network, a table or a model, not ",
             policy_text(policy), "."),
      class = "gym_error_argument", argument = "object", value = policy, call = call
    )
  }
  observation <- observations_from(newdata, policy, call)
  if (type == "action") {
    return(act(policy, observation))
  }
  values <- observation_rows(observation, policy$observation_space)$values
  outputs <- network_outputs(policy, values, call)
  if (ncol(outputs) == 1L) outputs[, 1L] else outputs
}

# The output of a table, and of values that are linear in features, is a value for each action.
predict_values <- function(policy, newdata, type) {
  if (type == "action") {
    return(act(policy, newdata))
  }
  if (inherits(policy, "gym_policy_table")) {
    observed <- observed_batch(newdata, states_of(policy))
    return(table_rows(policy, observed$batch, observed$n))
  }
  observed <- observed_batch(newdata, policy$observation_space)
  linear_values(policy$basis, policy$weights, policy$basis$of(observed$batch, observed$n))
}

# The observations in a data frame: the columns with their names, or all columns where it has none
# of these names.
observations_from <- function(newdata, policy, call) {
  if (!is.data.frame(newdata)) {
    return(newdata)
  }
  newdata <- narrow_values(newdata)
  discrete <- inherits(policy$observation_space, "gym_space_discrete")
  names <- number_names(policy$observation_space, if (discrete) 1L else policy$sizes[[1L]])
  if (any(names %in% names(newdata))) {
    absent <- setdiff(names, names(newdata))
    if (length(absent)) {
      gym_abort(
        paste0("`newdata` has no column ", paste0("`", absent, "`", collapse = ", "), "."),
        class = "gym_error_argument", argument = "newdata", value = newdata, call = call
      )
    }
    newdata <- newdata[names]
  }
  if (discrete) newdata[[1L]] else unname(as.matrix(newdata))
}
