# The decision map of a policy that observes the number of a state: what it does in each of them.

new_state_map <- function(place, call) {
  if (!inherits(place$action_space, "gym_space_discrete")) {
    gym_abort(
      paste0("A map of states shows actions that are Discrete, not ", format(place$action_space),
             "."),
      class = "gym_error_argument", argument = "policy", value = place$policy, call = call
    )
  }
  space <- place$observation_space
  states <- state_numbers(space)
  place$call <- call
  policy <- greedy_policy(place$policy)
  actions <- keep_random_state(act_batch(policy, states, length(states), place))
  structure(
    list(
      grid = data.frame(state = states, action = as.integer(actions)), x = "state", kind = "state",
      action_space = place$action_space, env_id = place$env_id, policy = place$policy
    ),
    class = c("gym_state_map", "gym_decision_map")
  )
}

#' @export
print.gym_state_map <- function(x, ...) {
  cat(
    paste0("Decision map", if (!is.null(x$env_id)) paste0(" in ", x$env_id), ": the action in ",
           count_of(nrow(x$grid), "state")),
    paste0("Policy: ", policy_text(x$policy)),
    sep = "\n"
  )
  invisible(x)
}
