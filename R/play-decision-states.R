# The decision map of a policy that observes the number of a state, or several such numbers: its
# action in each of them.

check_discrete_actions <- function(place, call) {
  if (!inherits(place$action_space, "gym_space_discrete")) {
    gym_abort(
      paste0("A map of states shows actions that are Discrete, not ", format(place$action_space),
             "."),
      class = "gym_error_argument", argument = "policy", value = place$policy, call = call
    )
  }
}

new_state_map <- function(place, call) {
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

#' Map a policy whose observations have several parts with few values each
#'
#' @param x,y,xlim,ylim,at As for [decision_map()].
#' @return As [decision_map()]; `panels` are the names of the parts on no axis.
#' @noRd
new_parts_map <- function(place, x, y, xlim, ylim, at, call) {
  space <- place$observation_space
  table_index(space, "observations", call)
  grid <- all_values(space)
  observed <- list(names = names(grid))
  axes <- if (is.null(x) && is.null(y)) 1:2 else mapped_axes(observed, x, y, call)
  ends <- list(xlim, ylim)
  shown <- rep(TRUE, nrow(grid))
  for (i in seq_along(axes)) {
    if (!is.null(ends[[i]])) {
      values <- grid[[axes[[i]]]]
      shown <- shown & values >= ends[[i]][[1L]] & values <= ends[[i]][[2L]]
    }
  }
  if (!is.null(at)) {
    observed$low <- observed$high <- numeric(length(grid))
    held_at(observed, axes, at, call)
    for (name in names(at)) shown <- shown & grid[[name]] == at[[name]]
  }
  grid <- grid[shown, , drop = FALSE]
  row.names(grid) <- NULL
  place$call <- call
  n <- nrow(grid)
  states <- named_batch(space, values_batch(space, grid))
  grid$action <- as.integer(keep_random_state(act_batch(place$policy, states, n, place)))
  if (inherits(place$policy, "gym_policy_table")) {
    row <- space_index(space)$index(states, n)
    grid$value <- row_max(place$policy$q)[row]
  }
  structure(
    list(
      grid = grid, x = observed$names[[axes[[1L]]]], y = observed$names[[axes[[2L]]]],
      kind = "parts", panels = setdiff(observed$names[-axes], names(at)), at = at,
      actions = action_names(
        place$env_id, as.integer(place$action_space$n), place$action_space$start
      ),
      action_space = place$action_space, env_id = place$env_id, policy = place$policy
    ),
    class = c("gym_parts_map", "gym_decision_map")
  )
}
