# Makes the decision map of a policy whose observations can be counted: one number of a state, or
# several numbers. The map has the action in each state.

# Are observations a single number, or several numbers with few values each, like Blackjack's?
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
  space <- place$observation_space
  index <- table_index(space, "observations", call)
  map <- if (inherits(space, "gym_space_discrete")) {
    grid <- data.frame(state = state_numbers(space))
    list(grid = grid, x = "state", kind = "state", in_play = states_in_play(env, client))
  } else {
    mapped_parts(space, x, y, xlim, ylim, at, call)
  }
  rows <- which(rep_len(map$in_play & has_action(place$policy), nrow(map$grid)))
  map$grid$action <- NA_integer_
  if (length(rows)) {
    place$call <- call
    observed <- named_batch(space, index$value(rows))
    map$grid$action[rows] <- as.integer(keep_random_state(
      act_batch(greedy_policy(place$policy), observed, length(rows), place)
    ))
  }
  if (map$kind == "parts") {
    if (inherits(place$policy, "gym_policy_table")) map$grid$value <- row_max(place$policy$q)
    map$grid <- map$grid[map$in_play, , drop = FALSE]
    row.names(map$grid) <- NULL
  }
  map$in_play <- NULL
  structure(class = c("gym_state_map", "gym_decision_map"), c(map, list(
    actions = action_names(
      place$env_id, as.integer(place$action_space$n), place$action_space$start
    ),
    observation_space = space, action_space = place$action_space, env_id = place$env_id,
    wrappers = place$wrappers, policy = place$policy
  )))
}

# Does a table have an action in each row? It needs a valid action, and the values of valid actions
# must not all be equal, as they are in states that were never visited. Other policies always have
# an action.
has_action <- function(policy) {
  if (!inherits(policy, "gym_policy_table")) {
    return(TRUE)
  }
  valid <- rowSums(policy$q > -Inf)
  valid == 1 | rowSums(policy$q == row_max(policy$q)) < valid
}

# The states in which an episode may choose an action: all, if there is no model.
states_in_play <- function(env, client) {
  none <- function(cnd) NULL
  model <- tryCatch(
    if (!is.null(env)) env_model(env, client = client),
    gym_error_no_model = none, gym_error_http_400 = none
  )
  if (is.null(model)) TRUE else ways_of(model)$reached
}

# Makes the map of observations that have several parts, without the actions. `in_play` says which
# rows to show; `panels` are the names of the parts that are on no axis.
mapped_parts <- function(space, x, y, xlim, ylim, at, call) {
  grid <- all_values(space)
  observed <- list(names = names(grid))
  axes <- if (is.null(x) && is.null(y)) 1:2 else mapped_axes(observed, x, y, call)
  if (!is.null(at)) {
    observed$low <- observed$high <- numeric(length(grid))
    held_at(observed, axes, at, call)
  }
  axes <- observed$names[axes]
  ends <- c(stats::setNames(list(xlim, ylim), axes), lapply(at, rep, 2L))
  in_play <- rep(TRUE, nrow(grid))
  for (name in names(ends)[lengths(ends) > 0L]) {
    in_play <- in_play & grid[[name]] >= ends[[name]][[1L]] & grid[[name]] <= ends[[name]][[2L]]
  }
  list(
    grid = grid, x = axes[[1L]], y = axes[[2L]], kind = "parts", in_play = in_play, at = at,
    panels = setdiff(observed$names, c(axes, names(at)))
  )
}
