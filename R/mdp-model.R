#' Make a model from a table of transitions
#'
#' Make a model from your own table. A model is the table of transitions of an environment with
#' finitely many states. For each state and action it has the next states, their probabilities and
#' their rewards. [env_model()] returns the model of an existing environment, and [estimate_model()]
#' estimates a model from steps.
#'
#' [solve_mdp()] solves a model, and [evaluate_policy()][evaluate_policy.gym_model()] evaluates a
#' policy by it exactly. A model is also an environment: [rollout()], [train_agent()] and all other
#' functions that play accept it. [model_env()] makes it an object with `$reset()` and `$step()`.
#'
#' States and actions have the environment's own numbers, which start at 0 in Gymnasium. Rows and
#' columns of matrices and vectors start at 1, as always in R: the first row belongs to the lowest
#' number.
#'
#' States and actions may also have names: text or factors, or several columns, such as `row` and
#' `column` for the states. In play, each state and action is then a number from 0, in the order of
#' the levels, or of the columns. Results, tables and pictures show the names. You can also ask
#' policies by name: `predict(solution, "low")`.
#'
#' @param transitions A data frame with a row for each transition and the columns `state`, `action`
#'   and `next_state` (whole numbers, text or factors), `reward` (a number), and optionally
#'   `probability` (default 1) and `terminated` (whether the episode ends there; by default `TRUE`
#'   if no row leaves `next_state`). An action without a row in a state is invalid there.
#' @param state The names of the columns of the state, strings. The default is `"state"`. The
#'   columns of the next state have the same names after `next_`.
#' @param action The names of the columns of the action, strings. The default is `"action"`. If
#'   there are several, results show each as `action_` and its name.
#' @param start Where episodes start: a state's number or name, or several of them, which are
#'   equally likely; or probabilities, with the states' numbers or names as names, or one for each
#'   state. (A vector with an element for each state has probabilities.) `NULL`, the default, draws
#'   uniformly from the states that some row leaves.
#' @param id The model's name in messages and titles, a string.
#' @param max_episode_steps The number of steps after which an episode is cut off in play, a whole
#'   number. `NULL`, the default, sets no limit.
#' @param reward_threshold The mean return from which the model counts as solved, a number. `NULL`,
#'   the default, sets none.
#' @return An object of class `gym_model`, a list with the elements
#'   \describe{
#'     \item{transitions}{A data frame with the columns `state`, `action`, `next_state` (integer),
#'       `probability`, `reward` (double) and `terminated` (logical), sorted by state and action.
#'       `as.data.frame()` returns it with the names of states and actions.}
#'     \item{start}{The probability that each state is the first one, a numeric vector with the
#'       states' numbers as names.}
#'     \item{observation_space, action_space}{The spaces of the states and of the actions, both
#'     Discrete.}
#'     \item{spec}{A list of `id`, `reward_threshold` and `max_episode_steps`.}
#'   }
#'   [model_arrays()] converts it to the arrays of other packages.
#' @section Errors: `gym_error_argument` for an invalid table: a missing column, probabilities that
#'   do not add up to 1 (the message names the state and the action), a state that no row leaves
#'   although an episode goes on there.
#' @seealso [env_model()], [estimate_model()], [solve_mdp()]
#' @export
#' @examples
#' # A machine can be run (0) or repaired (1). A worn machine (state 1) breaks (state 2) one
#' # time in five.
#' machine <- gym_model(data.frame(
#'   state =       c(0,   0,   0,  1,   1,   1),
#'   action =      c(0,   0,   1,  0,   0,   1),
#'   next_state =  c(0,   1,   0,  1,   2,   0),
#'   probability = c(0.7, 0.3, 1,  0.8, 0.2, 1),
#'   reward =      c(10,  10, -5,  6,   -50, -5)
#' ), start = 0, id = "Machine")
#' machine
#' solve_mdp(machine, discount = 0.95)
gym_model <- function(transitions, start = NULL, id = "R-model", max_episode_steps = NULL,
                      reward_threshold = NULL, state = "state", action = "action") {
  check_string(id)
  check_count(max_episode_steps, allow_null = TRUE)
  check_number(reward_threshold, allow_null = TRUE)
  spec <- list(
    id = id, reward_threshold = reward_threshold,
    max_episode_steps = if (!is.null(max_episode_steps)) as.integer(max_episode_steps)
  )
  coded <- coded_transitions(transitions, state, action, rlang::current_env())
  table <- check_transitions(coded$table)
  states <- coded$states %||% spanned_space(c(table$state, table$next_state), "states")
  actions <- coded$actions %||% spanned_space(table$action, "actions")
  new_model(table, states, actions, plain_numbers(start), spec)
}

# The space of all numbers from the lowest to the highest.
spanned_space <- function(numbers, what, call = rlang::caller_env()) {
  ends <- range(numbers)
  count <- as.double(ends[[2L]]) - ends[[1L]] + 1
  abort_if(
    count > most_values, "transitions", NULL, call,
    "The {what} are numbered from {ends[[1L]]} to {ends[[2L]]}, which makes
     {whole_number_text(count)} of them; at most {whole_number_text(most_values)} are possible.",
    i = "Number them without gaps."
  )
  space_discrete(count, ends[[1L]])
}

#' Make a model from a table
#'
#' @param start As for [gym_model()].
#' @param table As returned by [check_transitions()].
#' @param call The user's call.
#' @noRd
new_model <- function(table, states, actions, start, spec, call = rlang::caller_env()) {
  table <- table[order(table$state, table$action, method = "radix"), ]
  row.names(table) <- NULL
  check_fits_memory(
    as.double(states$n) * as.double(actions$n),
    paste("A model of", count_of(as.double(states$n), "state"), "with",
          count_of(as.double(actions$n), "action")),
    call, "transitions", "Number states and actions without gaps."
  )
  check_probabilities(table, states, actions, call)
  check_ends(table, states, call)
  structure(
    list(
      transitions = table, start = start_probabilities(start, table, states, call),
      observation_space = states, action_space = actions, spec = spec
    ),
    class = "gym_model"
  )
}

# Checks ----------------------------------------------------------------------------

check_transitions <- function(x, arg = "transitions", call = rlang::caller_env()) {
  if (!is.data.frame(x) || !nrow(x)) {
    abort_argument(x, "a data frame with a row for each transition", arg, call)
  }
  needed <- c("state", "action", "next_state", "reward")
  check_columns(x, needed, arg, call)
  for (name in intersect(c(needed, "probability"), names(x))) {
    x[[name]] <- plain_numbers(x[[name]], paste0(arg, "$", name), call)
  }
  for (name in needed[-4L]) {
    check_column(x, name, "whole numbers", are_whole_numbers, arg, call)
  }
  check_column(x, "reward", "finite numbers", are_finite, arg, call)
  # `$` would also match the start of a name, and would warn for a tibble.
  x[["probability"]] <- probability <- x[["probability"]] %||% rep(1, nrow(x))
  check_column(x, "probability", "numbers from 0 to 1", are_probabilities, arg, call)
  x[["terminated"]] <- terminated <- x[["terminated"]] %||% !x$next_state %in% x$state
  check_column(x, "terminated", "TRUE or FALSE", are_flags, arg, call)
  data.frame(
    state = as.integer(x$state), action = as.integer(x$action),
    next_state = as.integer(x$next_state), probability = as.double(probability),
    reward = as.double(x$reward), terminated = terminated
  )
}

check_is_model <- function(model, call = rlang::caller_env()) {
  if (!inherits(model, "gym_model")) {
    abort_argument(model, "a model made by `gym_model()`", "model", call)
  }
}

# The probabilities of a state and an action may be rounded, so their sum may differ from 1 by this.
sum_tolerance <- 1e-6

check_probabilities <- function(table, states, actions, call) {
  pair <- paste(table$state, table$action)
  sums <- rowsum(table$probability, pair, reorder = FALSE)[, 1L]
  wrong <- which(abs(sums - 1) > sum_tolerance)
  if (length(wrong)) {
    at <- strsplit(names(sums)[[wrong[[1L]]]], " ", fixed = TRUE)[[1L]]
    abort_wrong(
      "transitions", NULL, call,
      "The probabilities of action {value_labels(actions, as.integer(at[[2L]]))} in state
       {value_labels(states, as.integer(at[[1L]]))} add up to
       {format(sums[[wrong[[1L]]]], digits = 10)}, not to 1.",
      i = if (length(wrong) > 1L) {
        'The same holds for {count_of(length(wrong) - 1, "further pair")} of a state and an action.'
      }
    )
  }
}

check_ends <- function(table, states, call) {
  stuck <- !table$terminated & table$probability > 0 & !table$next_state %in% table$state
  abort_if(
    any(stuck), "transitions", NULL, call,
    "No row leaves state {value_labels(states, table$next_state[stuck][[1L]])}, and arriving there
     does not end the episode.",
    i = "Set `terminated` to TRUE in the rows that lead there, or add rows that leave it."
  )
}

start_probabilities <- function(start, table, states, call) {
  numbers <- state_numbers(states)
  labels <- value_labels(states)
  left <- numbers %in% table$state
  given <- start
  if (is.character(start) || is.factor(start)) start <- encoded_values(states, start, "state", call)
  if (is.null(start)) {
    start <- left / sum(left)
  } else if (!is.null(names(start))) {
    places <- match(names(start), labels)
    known <- !anyNA(places) && !anyDuplicated(places)
    start <- if (known) replace(numeric(length(numbers)), places, unname(start))
  } else if (is_number(start) || length(start) != length(numbers)) {
    known <- all(start %in% numbers) && !anyDuplicated(start)
    start <- if (known) (numbers %in% start) / length(start)
  }
  if (is.null(start) || !all(are_probabilities(start)) || abs(sum(start) - 1) > sum_tolerance) {
    must <- paste0(
      "the numbers of states, or probabilities that add up to 1, with the states' numbers as ",
      "names, or one for each of ", count_of(length(numbers), "state")
    )
    abort_argument(given, must, "start", call)
  }
  if (any(start[!left] > 0)) {
    must <- "the number of a state that some row leaves"
    abort_argument(labels[!left & start > 0][[1L]], must, "start", call)
  }
  stats::setNames(as.double(start), labels)
}

# Names of states and actions --------------------------------------------------------------

# In a model, states and actions are always numbers. If they have names, the spaces know these.

#' Number the states and actions of a table
#'
#' @param x A table of transitions or steps.
#' @param state,action The names of the columns of the state and of the action.
#' @return A list: `table`, with whole numbers in `state`, `action` and `next_state`; `states` and
#'   `actions`, spaces with names, `NULL` for those that were numbers.
#' @noRd
coded_transitions <- function(x, state, action, call, arg = "transitions") {
  if (!is.data.frame(x)) {
    return(list(table = x))
  }
  after <- paste0("next_", state)
  check_columns(x, c(state, after, action), arg, call)
  x <- as.data.frame(x)
  from <- x[state]
  to <- stats::setNames(x[after], state)
  coded <- list()
  if (length(state) > 1L || has_names(from[[1L]]) || has_names(to[[1L]])) {
    coded$states <- labelled_space(sorted_rows(unique(both_rows(from, to))))
    x$state <- encoded_values(coded$states, from, "state", call)
    x$next_state <- encoded_values(coded$states, to, "state", call)
  } else {
    x$state <- from[[1L]]
    x$next_state <- to[[1L]]
  }
  taken <- named_as_actions(x[action])
  if (length(action) > 1L || has_names(taken[[1L]])) {
    coded$actions <- labelled_space(sorted_rows(unique(taken)))
    x$action <- encoded_values(coded$actions, taken, "action", call)
  } else {
    x$action <- taken[[1L]]
  }
  coded$table <- x
  coded
}

has_names <- function(x) is.character(x) || is.factor(x) || is.logical(x)

# Combines the states of both columns. The factor of the first may lack states that were only
# reached.
both_rows <- function(from, to) {
  columns <- Map(function(x, y) {
    if (!is.factor(x) && !is.factor(y)) {
      return(c(x, y))
    }
    levels <- union(levels(x) %||% sort(unique(x)), levels(y) %||% sort(unique(y)))
    factor(c(as.character(x), as.character(y)), levels)
  }, from, to)
  data.frame(columns, check.names = FALSE, stringsAsFactors = FALSE)
}

sorted_rows <- function(x) {
  x <- x[do.call(order, unname(as.list(x))), , drop = FALSE]
  row.names(x) <- NULL
  x
}

# The transitions of a model with the names of states and actions.
named_transitions <- function(model) {
  table <- model$transitions
  states <- model$observation_space
  from <- table["state"]
  to <- table["next_state"]
  if (!is.null(states$values)) {
    from <- decoded_values(states, table$state)
    to <- decoded_values(states, table$next_state)
    names(to) <- paste0("next_", names(to))
  }
  data.frame(from, decoded_actions(model$action_space, table$action), to,
             table[c("probability", "reward", "terminated")], check.names = FALSE)
}

# Methods -----------------------------------------------------------------------------

#' @export
print.gym_model <- function(x, ...) {
  starts <- names(x$start)[x$start > 0]
  print_lines(x, paste0(
    "<model of ", x$spec$id, ": ", count_of(length(x$start), "state"), ", ",
    count_of(as.integer(x$action_space$n), "action"), ", ",
    count_of(nrow(x$transitions), "transition"), ", starts in ",
    if (length(starts) == 1L) paste("state", starts) else count_of(length(starts), "state"), ">"
  ))
}

#' @export
as.data.frame.gym_model <- function(x, row.names = NULL, optional = FALSE, ...) {
  named_transitions(x)
}

# As arrays ----------------------------------------------------------------------------

#' Convert a model to arrays
#'
#' Convert a model to the arrays that other packages use: `P` and `R` are those of MDPtoolbox
#' (`MDPtoolbox::mdp_value_iteration(P, R, discount)`), and together with `start` and the dimnames
#' they are those of markovDP.
#'
#' These packages do not have episodes. The arrays therefore have one more state, the last one.
#' Episodes go there when they end, and no action leaves it.
#'
#' @param model A model, see [gym_model()].
#' @return A list: `P`, an array of (S + 1) x (S + 1) x A for S states and A actions, whose element
#'   `[i, j, a]` is the probability that action a leads from state i to state j; `R`, a matrix of
#'   (S + 1) x A with the expected rewards; `start`, the probability that each state is the first
#'   one. The dimnames are the numbers of the states and actions, and `"end"`. An invalid action in
#'   a state leads to the end with a reward of `-Inf`.
#' @section Errors: `gym_error_argument` if `model` is not a model, or too large for an array.
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' model_arrays(walk)$P[, , "1"]
model_arrays <- function(model) {
  check_is_model(model)
  states <- length(model$start)
  actions <- as.integer(model$action_space$n)
  cells <- (states + 1)^2 * actions
  abort_if(
    cells > .Machine$integer.max, "model", model, rlang::current_env(),
    "An array of {whole_number_text(cells)} numbers is too large."
  )
  table <- model$transitions
  from <- state_rows(model, table$state)
  to <- ifelse(table$terminated, states + 1L, state_rows(model, table$next_state))
  action <- action_columns(model, table$action)
  name <- list(c(names(model$start), "end"), value_labels(model$action_space))
  p <- array(0, c(states + 1L, states + 1L, actions), name[c(1L, 1L, 2L)])
  sums <- rowsum(table$probability, from + (states + 1) * (to - 1 + (states + 1) * (action - 1)))
  p[as.double(rownames(sums))] <- sums
  r <- array(0, c(states + 1L, actions), name)
  expected <- rowsum(table$probability * table$reward, from + (states + 1) * (action - 1))
  r[as.double(rownames(expected))] <- expected
  # Invalid actions lead to the end, and the end leads to itself.
  barred <- rbind(!possible_actions(model), TRUE)
  at <- which(barred, arr.ind = TRUE)
  p[cbind(at[, 1L], states + 1L, at[, 2L])] <- 1
  r[barred & rowSums(!barred) > 0] <- -Inf
  list(P = p, R = r, start = c(model$start, end = 0))
}
