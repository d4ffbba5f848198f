#' Make a policy from a table of values
#'
#' Make a policy from a table with a row for each observation (a state) and a column for each
#' action. In each state the policy takes the action with the largest value, or the first of equal
#' ones. With `epsilon` it explores: with this probability it draws an action uniformly (Sutton and
#' Barto 2018, section 2.2). With `temperature` it draws each action with a probability proportional
#' to `exp(value / temperature)` (softmax, or Boltzmann, exploration).
#'
#' Observations are Discrete, MultiDiscrete, MultiBinary, or a Tuple or Dict of these. The rows are
#' in the order of a Discrete space's numbers. If an observation has several numbers, the last one
#' changes fastest from row to row. Action spaces are of these kinds, too. If an action has several
#' parts, the table has a column for each combination, in the same order, and the policy returns
#' actions with their parts.
#'
#' @param q A numeric matrix with a row for each state and a column for each action: values, or
#'   other numbers of which larger is better. `-Inf` marks an invalid action. It is an error if the
#'   policy gets to a state without a valid action.
#' @param epsilon The probability of exploring, a number from 0, the default, to 1.
#' @param temperature The temperature of the softmax, a number above 0. `NULL`, the default, draws
#'   no actions.
#' @return A policy of class `gym_policy_table`, for [act()], [rollout()] and [evaluate_policy()].
#' @section Errors: `gym_error_argument` for an invalid table, or one without the rows and columns
#'   that the environment needs.
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @seealso [solve_mdp()], which finds the best policy if the environment has a model
#' @export
#' @examples
#' # Two states, three actions.
#' policy <- policy_table(rbind(c(0, 1, 0), c(2, 0, 0)))
#' act(policy, c(0, 1, 1))
policy_table <- function(q, epsilon = 0, temperature = NULL) {
  q <- plain_numbers(q)
  if (!is.matrix(q) || !is.numeric(q) || !length(q) || anyNA(q)) {
    abort_argument(q, "a numeric matrix without missing values", "q", rlang::current_env())
  }
  check_in_order(q)
  check_number(epsilon, min = 0, max = 1)
  if (!is.null(temperature)) check_above_zero(temperature)
  structure(
    list(
      q = unname(q), epsilon = epsilon, temperature = temperature,
      observation_space = NULL, action_space = NULL
    ),
    class = c("gym_policy_table", "gym_policy")
  )
}

# Functions such as tapply() sort numbers as text, so that row 10 comes before row 2.
check_in_order <- function(q, call = rlang::caller_env()) {
  for (axis in 1:2) {
    names <- dimnames(q)[[axis]]
    if (isTRUE(is.unsorted(suppressWarnings(as.numeric(names))))) {
      sorted <- c("q[order(as.numeric(rownames(q))), ]", "q[, order(as.numeric(colnames(q)))]")
      abort_wrong(
        "q", q, call,
        'The {c("rows", "columns")[[axis]]} of `q` must be in the order of their numbers, not
         {few_names(names)}.',
        i = "`{sorted[[axis]]}` is."
      )
    }
  }
}

#' @export
act.gym_policy_table <- function(policy, observation, ...) {
  by_name <- !is.null(states_of(policy)$values) && !is.numeric(observation)
  if (by_name) observation <- encoded_values(states_of(policy), observation, "state", NULL)
  actions <- observed_actions(policy, observed_batch(observation, states_of(policy)))
  # If observations were given by name, return actions by name.
  if (by_name) named_numbers(policy$action_space, actions) else actions
}

# An action for an observation, or a batch of actions for a batch.
observed_actions <- function(policy, observed) {
  actions <- act_batch(policy, observed$batch, observed$n, NULL)
  if (observed$one) batch_value(policy$action_space, actions, 1L) else actions
}

#' @exportS3Method
predict_policy.gym_policy_table <- function(policy, newdata, type, call = rlang::caller_env()) {
  if (type == "action") {
    return(act(policy, newdata))
  }
  if (!is.null(states_of(policy)$values) && !is.numeric(newdata)) {
    newdata <- encoded_values(states_of(policy), newdata, "state", call)
  }
  observed <- observed_batch(newdata, states_of(policy), "newdata", call)
  # The output is a value for each action.
  rows <- table_rows(policy, observed$batch, observed$n)
  if (type == "probability") row_probabilities(policy, rows) else rows
}

# The observation space of a table's rows.
states_of <- function(policy) policy$observation_space %||% space_discrete(nrow(policy$q))

#' @exportS3Method
act_batch.gym_policy_table <- function(policy, observation, n, vector_env) {
  rows <- table_rows(policy, observation, n, vector_env$call)
  actions <- policy$action_space %||% space_discrete(ncol(rows))
  space_index(actions)$value(draw_table_actions(policy, rows))
}

# The rows of the table for some observations.
table_rows <- function(policy, observation, n, call = rlang::caller_env()) {
  space <- states_of(policy)
  number <- rows_of_table(space_index(space), space, observation, n, call)
  rows <- policy$q[number, , drop = FALSE]
  abort_if(
    any(rows[, 1L] == -Inf) && any(row_max(rows) == -Inf), "policy", policy, call,
    "Row {number[row_max(rows) == -Inf][[1L]]} of the policy's table leaves no action: all its
     values are -Inf."
  )
  rows
}

# The numbers of the chosen actions, from 1.
draw_table_actions <- function(policy, rows) {
  if (!is.null(policy$temperature)) {
    return(draw_by_row(row_probabilities(policy, rows)))
  }
  choice <- best_column(rows)
  if (policy$epsilon > 0) {
    explores <- stats::runif(length(choice)) < policy$epsilon
    if (any(explores)) {
      possible <- rows[explores, , drop = FALSE] > -Inf
      choice[explores] <- draw_by_row(possible / rowSums(possible))
    }
  }
  choice
}

# The probability of each action in each state. A state without actions is terminal and its row does
# not matter.
table_probabilities <- function(policy) {
  q <- policy$q
  q[row_max(q) == -Inf, ] <- 0
  row_probabilities(policy, q)
}

# The probability of each action, a row for each state.
row_probabilities <- function(policy, rows) {
  if (!is.null(policy$temperature)) {
    return(softmax_rows(rows, policy$temperature))
  }
  possible <- rows > -Inf
  p <- policy$epsilon * possible / rowSums(possible)
  best <- cbind(seq_len(nrow(rows)), best_column(rows))
  p[best] <- p[best] + 1 - policy$epsilon
  p
}

#' @exportS3Method
policy_bind.gym_policy_table <- function(policy, env, call = rlang::caller_env()) {
  env <- one_sub_env(env)
  states <- table_index(env$observation_space, "observations", call)$count
  actions <- table_index(env$action_space, "actions", call)$count
  abort_if(
    nrow(policy$q) != states || ncol(policy$q) != actions, "policy", policy, call,
    "The policy's table has {count_of(nrow(policy$q), 'row')} and
     {count_of(ncol(policy$q), 'column')}, but {environment_label(env)} has
     {count_of(states, 'state')} and {count_of(actions, 'action')}: a table has a row for each
     state and a column for each action."
  )
  policy$observation_space <- env$observation_space
  policy$action_space <- env$action_space
  policy
}

#' @export
format.gym_policy_table <- function(x, ...) {
  how <- c(
    paste0("table ", nrow(x$q), " x ", ncol(x$q)),
    if (x$epsilon > 0) paste("epsilon", number_text(x$epsilon)),
    if (!is.null(x$temperature)) paste("softmax of temperature", number_text(x$temperature))
  )
  paste(how, collapse = ", ")
}
