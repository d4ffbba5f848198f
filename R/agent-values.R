# What the learners of values have in common: how they begin, act, and move a value towards a
# target.

#' Make a learner of values
#'
#' @param class Its class.
#' @param settings What the user has chosen, a list, among it `features`, `discount`,
#'   `learning_rate`, `epsilon`, `temperature` and `initial`, and perhaps `n` and `lambda`.
#' @return While it learns it has `basis`, see [basis_of()], and `weights`, a matrix with a row for
#'   each feature and a column for each action; `taken`, how many steps it has observed;
#'   `next_action`, the actions that were chosen already, by sub-environment; and `traces` or
#'   `pending` of each sub-environment.
#' @noRd
new_learner <- function(class, settings) {
  structure(settings, class = c(class, "gym_value_learner", "gym_learner", "gym_agent"))
}

check_learner <- function(settings, call = rlang::caller_env()) {
  check_discount(settings$discount, "discount", call)
  for (name in intersect(c("learning_rate", "epsilon"), names(settings))) {
    check_schedule(settings[[name]], name, 0, 1, call)
  }
  if (!is.null(settings$temperature)) {
    check_schedule(settings$temperature, "temperature", lowest_temperature, Inf, call)
  }
  check_number(settings$initial, arg = "initial", call = call)
  features <- settings$features
  if (!is.null(features) && !is.function(features) && !inherits(features, "gym_features")) {
    must <- "NULL, what `tile_coding()` makes, or a function of observations"
    abort_argument(features, must, "features", call)
  }
  check_string(settings$mask, arg = "mask", allow_null = TRUE, call = call)
  if (!is.null(settings$mask) && !is.null(features)) {
    gym_abort(
      "`mask` is for a table, not for features: a table keeps what is forbidden where.",
      class = "gym_error_argument", argument = "mask", value = settings$mask, call = call
    )
  }
}

# Beginning ---------------------------------------------------------------------------

#' @export
agent_start.gym_value_learner <- function(agent, policy) {
  call <- NULL
  if (!inherits(policy$action_space, "gym_space_discrete")) {
    gym_abort(
      c(paste0("A learner of values needs actions that can be counted, not ",
               format(policy$action_space), "."),
        i = "`search_ars()` and `search_cem()` learn actions that are numbers of a range."),
      class = "gym_error_argument", argument = "env", call = call
    )
  }
  agent$spaces <- policy[c("observation_space", "action_space")]
  agent$basis <- basis_of(agent$features, policy$observation_space, call)
  agent$taken <- 0
  agent$next_action <- integer()
  agent["weights"] <- list(first_weights(agent, policy))
  agent$traces <- list()
  agent$pending <- list()
  agent
}

# How many columns the weights have: one for each action.
value_columns_of <- function(agent) UseMethod("value_columns_of")

#' @exportS3Method
value_columns_of.default <- function(agent) as.integer(agent$spaces$action_space$n)

first_weights <- function(agent, policy) {
  if (!is.null(policy$q)) {
    check_first_table(agent, policy)
    return(policy$q)
  }
  if (is.na(agent$basis$count)) {
    # A user's function has not been asked yet.
    return(NULL)
  }
  each <- agent$basis$each
  weights <- matrix(as.double(agent$initial) / each, agent$basis$count, value_columns_of(agent))
  if (is.null(agent$features) && identical(dim(weights), dim(policy$possible))) {
    # What a state does not have is never taken; of an end no action is.
    weights[!policy$possible & rowSums(policy$possible) > 0] <- -Inf
  }
  weights
}

check_first_table <- function(agent, policy) {
  if (!is.null(agent$features) || ncol(policy$q) != value_columns_of(agent)) {
    gym_abort(
      "A table to begin with is for learners of a table with a column for each action.",
      class = "gym_error_argument", argument = "policy", value = policy, call = NULL
    )
  }
}

with_known_weights <- function(agent, present) {
  if (is.null(agent$weights)) {
    agent$weights <- matrix(0, ncol(present), value_columns_of(agent))
  }
  agent
}

# Acting ------------------------------------------------------------------------------

#' @export
agent_act.gym_value_learner <- function(agent, observation, sub_env) {
  action <- agent$next_action[sub_env]
  new <- is.na(action)
  if (any(new)) {
    values <- values_of(agent, seen_by(agent, observation, sub_env), action_weights(agent))
    action[new] <- choose_actions(agent, values)[new]
  }
  action - 1L + agent$spaces$action_space$start
}

# The features of observations, of which there is one for each sub-environment.
seen_by <- function(agent, observation, sub_env) {
  present <- agent$basis$of(observation, length(sub_env))
  weights <- agent$weights
  if (is.null(agent$basis$each) && !is.null(weights) && ncol(present) != nrow(weights)) {
    gym_abort(
      paste0("`features` returned ", count_of(nrow(weights), "feature"), " at first, and now ",
             ncol(present), "."),
      class = "gym_error_argument", argument = "features", call = NULL
    )
  }
  present
}

values_of <- function(agent, present, weights = agent$weights) {
  if (is.null(weights)) {
    matrix(0, nrow(present), value_columns_of(agent))
  } else {
    linear_values(agent$basis, weights, present)
  }
}

# How it explores at the moment.
exploration <- function(agent) {
  list(
    epsilon = scheduled(agent$epsilon %||% 0, agent$taken, "epsilon"),
    temperature = if (!is.null(agent$temperature)) {
      scheduled(agent$temperature, agent$taken, "temperature", lowest_temperature, Inf)
    }
  )
}

# The numbers of the actions that are taken, from 1. Of equal values one is drawn, so that a learner
# which knows nothing yet goes everywhere.
choose_actions <- function(agent, values) {
  draw_table_actions(exploration(agent), values, best = any_best_column)
}

#' @export
agent_policy.gym_value_learner <- function(agent) {
  weights <- action_weights(agent)
  if (is.null(agent$features)) {
    policy <- policy_table(weights)
    policy[c("observation_space", "action_space")] <- agent$spaces
    policy
  } else {
    weights <- weights %||% matrix(0, 0L, value_columns_of(agent))
    new_feature_policy(agent$basis, weights, agent$spaces)
  }
}

# Learning ----------------------------------------------------------------------------

#' Move values towards what a step has come to
#'
#' @param present,column The features that were seen, and the columns of the weights whose values
#'   are moved.
#' @param transitions As [agent_observe()] gets them.
#' @param ahead The value of what the step led to, as far as the episode goes on.
#' @noRd
learn_from <- function(agent, present, column, transitions, ahead) {
  n <- length(column)
  ahead[transitions$terminated] <- 0
  if (isTRUE(agent$lambda > 0)) {
    agent <- learn_by_traces(agent, present, column, transitions, ahead)
  } else if (isTRUE(agent[["n"]] > 1L)) {
    agent <- learn_by_steps(agent, present, column, transitions, ahead)
  } else {
    value <- values_of(agent, present)[cbind(seq_len(n), column)]
    error <- transitions$reward + agent$discount * ahead - value
    rate <- scheduled(agent$learning_rate, agent$taken, "learning_rate")
    agent$weights <- move_weights(agent$basis, agent$weights, present, column, rate, error)
  }
  agent$taken <- agent$taken + n
  agent
}

#' Change weights so that values move by a share of their errors
#'
#' Errors of the same state and action move its value by their mean, as far as if they had come one
#' after the other: k errors at a rate r by 1 - (1 - r)^k of it.
#' @noRd
move_weights <- function(basis, weights, present, column, rate, error) {
  if (is.null(basis$each)) {
    return(move_dense_weights(weights, present, column, rate, error))
  }
  cell <- as.vector(present + nrow(weights) * (column - 1L))
  if (length(column) == 1L) {
    weights[cell] <- weights[cell] + rate / basis$each * error
    return(weights)
  }
  error <- rep(error, basis$each)
  if (anyDuplicated(cell)) {
    own <- unique(cell)
    group <- match(cell, own)
    count <- tabulate(group, length(own))
    error <- rowsum(error, group)[, 1L] / count
    weights[own] <- weights[own] + (1 - (1 - rate)^count) / basis$each * error
  } else {
    weights[cell] <- weights[cell] + rate / basis$each * error
  }
  weights
}

move_dense_weights <- function(weights, present, column, rate, error) {
  for (action in unique(column)) {
    own <- column == action
    step <- colMeans(present[own, , drop = FALSE] * error[own])
    weights[, action] <- weights[, action] + (1 - (1 - rate)^sum(own)) * step
  }
  weights
}

# Results -----------------------------------------------------------------------------

#' Get the values that were learned
#'
#' @param x What `learn_q()` and the others returned, or their agent.
#' @return A numeric vector with an element for each state, in the order of the table's rows: the
#'   value of its best action, or, from [learn_td()], that of the state. The elements are named by
#'   the numbers of the states where observations are Discrete. States that were never left, such as
#'   ends, have the value that all had at first.
#' @section Errors: `gym_error_argument` for what was not learned by a table.
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' learned <- learn_td(walk, policy_random(), iterations = 50, seed = 1)
#' state_values(learned)
state_values <- function(x) {
  agent <- if (inherits(x, "gym_training")) x$agent else x
  if (!inherits(agent, "gym_value_learner") || is.null(agent$weights) ||
        !is.null(agent$features)) {
    must <- "what was learned by a table, as `learn_q()` returns it"
    abort_argument(x, must, "x", rlang::current_env())
  }
  values <- row_max(action_weights(agent))
  space <- agent$spaces$observation_space
  if (inherits(space, "gym_space_discrete")) names(values) <- state_numbers(space)
  values
}

# The table of values that the greedy policy is by.
action_weights <- function(agent) UseMethod("action_weights")

#' @exportS3Method
action_weights.default <- function(agent) agent$weights

learner_text <- function(name, agent, settings = NULL) {
  texts <- c(
    if (length(settings)) paste(names(settings), vapply(settings, format, "")),
    if (!is.null(agent$learning_rate)) paste("learning_rate", schedule_text(agent$learning_rate)),
    if (!is.null(agent$temperature)) {
      paste("temperature", schedule_text(agent$temperature))
    } else if (!is.null(agent$epsilon)) {
      paste("epsilon", schedule_text(agent$epsilon))
    },
    paste("discount", number_text(agent$discount))
  )
  paste0(name, ": ", paste(texts, collapse = ", "))
}
