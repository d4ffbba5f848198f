# The decision map of a policy that observes the number of a state, or several such numbers: its
# action in each of them.

# One number, or several with few values each, like Blackjack's.
is_counted <- function(space) {
  inherits(space, "gym_space_discrete") ||
    !is.null(space) && !is.null(space_index(space)) && length(digit_values(space)) > 1L
}

counted_map <- function(place, env, client, x, y, xlim, ylim, at, call) {
  if (!inherits(place$action_space, "gym_space_discrete")) {
    abort_wrong("policy", place$policy, call,
                "A map of states shows actions that are Discrete, not
                 {format(place$action_space)}.")
  }
  if (inherits(place$observation_space, "gym_space_discrete")) {
    new_state_map(place, env, client, call)
  } else {
    new_parts_map(place, x, y, xlim, ylim, at, call)
  }
}

# Whether a policy has an action in some rows of its table: one is valid, and not all valid ones
# have the same value, as in states that were never visited. Other policies always have one.
has_action <- function(policy, rows) {
  if (!inherits(policy, "gym_policy_table")) {
    return(rep(TRUE, length(rows)))
  }
  q <- policy$q[rows, , drop = FALSE]
  valid <- rowSums(q > -Inf)
  valid == 1 | rowSums(q == row_max(q)) < valid
}

# The actions in some of the states, `NA` in the others. `batch_at` gives the observations of rows.
actions_where <- function(some, policy, batch_at, place) {
  rows <- which(some)
  actions <- rep(NA_integer_, length(some))
  if (length(rows)) {
    chosen <- keep_random_state(act_batch(policy, batch_at(rows), length(rows), place))
    actions[rows] <- as.integer(chosen)
  }
  actions
}

new_state_map <- function(place, env, client, call) {
  none <- function(cnd) NULL
  model <- tryCatch(
    if (!is.null(env)) env_model(env, client = client),
    gym_error_no_model = none, gym_error_http_400 = none
  )
  # The states in which an episode may choose an action: all, if there is no model.
  in_play <- if (is.null(model)) TRUE else state_kinds(model)$reached
  space <- place$observation_space
  states <- state_numbers(space)
  place$call <- call
  actions <- actions_where(
    in_play & has_action(place$policy, seq_along(states)),
    greedy_policy(place$policy), function(rows) states[rows], place
  )
  structure(class = c("gym_state_map", "gym_decision_map"), list(
    grid = data.frame(state = states, action = actions), x = "state", kind = "state",
    observation_space = space, action_space = place$action_space, env_id = place$env_id,
    wrappers = place$wrappers, policy = place$policy
  ))
}

#' Map a policy whose observations have several parts with few values each
#'
#' @param x,y,xlim,ylim,at As for [decision_map()].
#' @return As [decision_map()]; `panels` are the names of the parts on no axis.
#' @noRd
new_parts_map <- function(place, x, y, xlim, ylim, at, call) {
  space <- place$observation_space
  index <- table_index(space, "observations", call)
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
  rows <- which(shown)
  grid$action <- actions_where(
    has_action(place$policy, rows), place$policy,
    function(some) named_batch(space, index$value(rows[some])), place
  )
  if (inherits(place$policy, "gym_policy_table")) grid$value <- row_max(place$policy$q)[rows]
  structure(class = c("gym_state_map", "gym_decision_map"), list(
    grid = grid, x = observed$names[[axes[[1L]]]], y = observed$names[[axes[[2L]]]],
    kind = "parts", panels = setdiff(observed$names[-axes], names(at)), at = at,
    actions = action_names(
      place$env_id, as.integer(place$action_space$n), place$action_space$start
    ),
    action_space = place$action_space, env_id = place$env_id,
    wrappers = place$wrappers, policy = place$policy
  ))
}
