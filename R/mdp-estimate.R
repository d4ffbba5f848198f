#' Estimate a model from steps
#'
#' Estimate a model from steps that were played. The probability of a transition is its share among
#' the steps with the same state and action (maximum likelihood). Actions that were never tried are
#' not in the model.
#'
#' @param x The result of [rollout()] with `steps = TRUE, next_observation = TRUE`, or a data frame
#'   with the columns `state`, `action`, `next_state`, `reward` and `terminated`. The columns
#'   `episode` and `step` tell which rows are the first of an episode, and so where episodes start.
#'   Without `step`, the rows of each episode must be in order. Without both columns, an episode
#'   goes on in the next row until it is terminated. Observations and actions of several parts that
#'   can be counted, such as those of a MultiDiscrete space, become states and actions with the
#'   names of their columns. `x` may also be the result of [steps_data()], whose states and actions
#'   keep their names. If a step ends an episode and its next state is not known, it leads back to
#'   its own state.
#' @param ... For methods.
#' @return A model, see [gym_model()]. If the rollout's policy knows the environment's spaces, the
#'   model has all their states and actions. Otherwise it has those from the lowest to the highest
#'   number in the steps. A state that was reached but never left, because episodes were cut off
#'   there, counts as terminal; a message says so.
#' @section Errors: `gym_error_argument` for a rollout without steps, observations that cannot be
#'   counted, or rows that are not in order.
#' @seealso [env_model()], which gets the model from the environment
#' @export
#' @examplesIf gym:::can_start_server()
#' played <- rollout("FrozenLake-v1", policy_random(), episodes = 1000, seed = 1, steps = TRUE,
#'                   next_observation = TRUE)
#' estimated <- estimate_model(played)
#' estimated
#' solve_mdp(estimated, horizon = 100)$start_value
estimate_model <- function(x, ...) UseMethod("estimate_model")

#' @export
estimate_model.default <- function(x, ...) {
  must <- "a rollout with its steps, or a data frame of steps"
  abort_argument(x, must, "x", rlang::current_env())
}

#' @export
estimate_model.gym_rollout <- function(x, ...) {
  call <- rlang::current_env()
  steps <- x$steps
  # The policy knows the environment's spaces, unless it is a function.
  spaces <- if (inherits(x$policy, "gym_policy")) x$policy[c("observation_space", "action_space")]
  if (is.data.frame(steps)) {
    spaces <- counted_spaces(spaces, steps)
    steps <- steps_by_number(steps, spaces, call)
  }
  after <- grep("^next_", names(steps), value = TRUE)
  abort_if(
    !is.data.frame(steps) || !length(after), "x", x, call,
    "The rollout lacks the steps, or the next observations.",
    i = "Play it with `rollout(steps = TRUE, next_observation = TRUE)`."
  )
  abort_if(
    length(after) != 1L || !is.integer(steps[[after]]) || !is.integer(steps$action), "x", x, call,
    "A model has numbered states and actions, but those of {x$env_id} are not Discrete."
  )
  table <- data.frame(
    steps[intersect(c("candidate", "episode", "step"), names(steps))],
    state = steps[[sub("^next_", "", after)]], action = steps$action,
    next_state = steps[[after]], reward = steps$reward,
    terminated = steps$terminated
  )
  attr(table, "spaces") <- spaces
  model <- estimate_model(table)
  model$spec$id <- paste(x$env_id, "(estimated)")
  model
}

#' @export
estimate_model.data.frame <- function(x, ...) {
  call <- rlang::current_env()
  if (is.null(x[["terminated"]])) x[["terminated"]] <- rep(FALSE, nrow(x))
  x[["probability"]] <- NULL
  steps <- check_transitions(x, "x", call)
  first <- first_rows(steps, x, call)
  steps$terminated <- end_at_unknown(steps)
  key <- do.call(paste, steps[c("state", "action", "next_state", "reward", "terminated")])
  count <- rowsum(rep(1, nrow(steps)), key, reorder = FALSE)[, 1L]
  table <- steps[!duplicated(key), ]
  pair <- paste(table$state, table$action)
  tried <- rowsum(count, pair, reorder = FALSE)[, 1L]
  table$probability <- unname(count / tried[pair])
  spaces <- attr(x, "spaces")
  states <- spaces$observation_space %||% spanned_space(c(table$state, table$next_state), "states")
  actions <- spaces$action_space %||% spanned_space(table$action, "actions")
  numbers <- state_numbers(states)
  starts <- tabulate(match(steps$state[first], numbers), length(numbers))
  new_model(
    table, states, actions, stats::setNames(starts / sum(starts), value_labels(states)),
    list(id = "estimated model", reward_threshold = NULL, max_episode_steps = NULL), call
  )
}

# Observations and actions of several parts that can be counted, such as those of a MultiDiscrete
# space, become states and actions with the names of their columns.
counted_spaces <- function(spaces, steps) {
  space <- spaces$observation_space
  after <- grep("^next_", names(steps), value = TRUE)
  if (length(after) > 1L && is.null(space$values) && !is.null(space_index(space))) {
    values <- all_values(space)
    spaces$observation_space <- labelled_space(stats::setNames(values, sub("^next_", "", after)))
  }
  spaces$action_space <- countable_actions(spaces$action_space) %||% spaces$action_space
  spaces
}

# Converts the names of states and actions to numbers.
steps_by_number <- function(steps, spaces, call) {
  columns <- names(spaces$observation_space$values)
  after <- paste0("next_", columns, recycle0 = TRUE)
  if (length(columns) && all(after %in% names(steps))) {
    own <- spaces$observation_space
    state <- encoded_values(own, steps, "state", call)
    next_state <- encoded_values(own, stats::setNames(steps[after], columns), "state", call)
    steps <- steps[setdiff(names(steps), c(columns, after))]
    steps[c("state", "next_state")] <- list(state, next_state)
  }
  parts <- spaces$action_space$values
  if (!is.null(parts)) {
    action <- encoded_values(spaces$action_space, steps[names(parts)], "action", call)
    steps <- steps[setdiff(names(steps), names(parts))]
    steps$action <- action
  }
  steps
}

# The rows of the first steps of episodes.
first_rows <- function(steps, x, call) {
  steps$row <- seq_len(nrow(steps))
  if (is.null(x[["episode"]]) && is.null(x[["step"]])) {
    steps$episode <- cumsum(c(TRUE, steps$terminated[-nrow(steps)]))
  } else {
    steps[c("candidate", "episode", "step")] <- as.list(x)[c("candidate", "episode", "step")]
    steps <- steps_by_episode(steps, "x", call)
  }
  check_order(steps, x, call)
  steps$row[!duplicated(steps$episode)]
}

# Checks that in an episode each step starts in the next state of the step before.
check_order <- function(steps, x, call) {
  before <- steps[-nrow(steps), ]
  after <- steps[-1L, ]
  next_one <- if (is.null(steps$step)) TRUE else after$step == before$step + 1
  apart <- before$terminated | before$next_state != after$state
  wrong <- which(before$episode == after$episode & next_one & apart)
  if (length(wrong)) {
    i <- wrong[[1L]]
    abort_wrong(
      "x", x, call,
      'Row {after$row[[i]]} of `x` does not follow row {before$row[[i]]}: that one leads to state
       {before$next_state[[i]]}{if (before$terminated[[i]]) ", where the episode ends"}, and row
       {after$row[[i]]} starts in state {after$state[[i]]}.',
      i = "The columns `episode` and `step` tell which row follows which."
    )
  }
}

# If no step has left a state, nothing is known about it. So an episode ends there.
end_at_unknown <- function(steps) {
  stuck <- !steps$terminated & !steps$next_state %in% steps$state
  count <- length(unique(steps$next_state[stuck]))
  if (count) {
    cli::cli_inform(
      c(i = "{count} state{?s} {?was/were} reached but never left: the model ends there."),
      class = "gym_message_model"
    )
  }
  steps$terminated | stuck
}
