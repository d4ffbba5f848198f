# Policies in a model: the probability of each action in each state.

#' Compute the probabilities with which a policy acts
#'
#' @param policy As for [solve_mdp()].
#' @return A matrix with a row for each state and a column for each action.
#' @noRd
policy_matrix <- function(policy, model, call) {
  possible <- possible_actions(model)
  policy <- plain_numbers(policy, "policy", call)
  if (is.numeric(policy)) policy <- in_model_order(policy, model, call)
  probabilities <- if (is.matrix(policy) && is.numeric(policy)) {
    check_policy_matrix(policy, possible, call)
  } else if (is.numeric(policy)) {
    rows_of_actions(policy, model, "policy", call)
  } else {
    check_policy(policy, "policy", call)
    check_one_policy(policy, "policy", call)
    policy_probabilities(policy_bind(policy, model, call = call), model, call)
  }
  probabilities[rowSums(possible) == 0, ] <- 0
  barred <- probabilities > 0 & !possible
  if (any(barred & rowSums(possible) > 0)) {
    at <- which(barred & rowSums(possible) > 0, arr.ind = TRUE)[1L, ]
    gym_abort(
      paste0("The policy takes action ", state_numbers(model$action_space)[[at[[2L]]]],
             " in state ", state_numbers(model$observation_space)[[at[[1L]]]],
             ", where the model does not have that action."),
      class = "gym_error_argument", argument = "policy", value = policy, call = call
    )
  }
  probabilities[barred] <- 0
  probabilities
}

# Actions, or rows and columns of probabilities, in the order of the model, by their names.
in_model_order <- function(policy, model, call) {
  states <- names(model$start)
  order_of <- function(given, forms, what, labels) {
    places_of_names(given, forms, labels) %||% gym_abort(
      c(paste0("The names of `policy` must be those of the ", what, ", ", few_names(forms[[1L]]),
               ", not ", few_names(given), "."),
        i = "Without names it is taken in their order: `unname()` removes them."),
      class = "gym_error_argument", argument = "policy", value = policy, call = call
    )
  }
  if (!is.matrix(policy)) {
    return(unname(policy[order_of(names(policy), list(states), "states", FALSE)]))
  }
  actions <- as.character(state_numbers(model$action_space))
  meaning <- action_meaning(model$spec$id, length(actions))
  row <- order_of(rownames(policy), list(states), "states", TRUE)
  column <- order_of(colnames(policy), list(actions, meaning), "actions", is.null(meaning))
  unname(policy[row, column, drop = FALSE])
}

possible_actions <- function(model) {
  possible <- matrix(FALSE, length(model$start), as.integer(model$action_space$n))
  table <- model$transitions
  possible[cbind(state_rows(model, table$state), action_columns(model, table$action))] <- TRUE
  possible
}

check_policy_matrix <- function(policy, possible, call) {
  good <- identical(dim(policy), dim(possible)) && all(are_probabilities(policy)) &&
    all(abs(rowSums(policy) - 1) < sum_tolerance | rowSums(possible) == 0)
  if (!good) {
    must <- paste0("a matrix of probabilities, with ", count_of(nrow(possible), "row"), " and ",
                   count_of(ncol(possible), "column"), ", each row of which adds up to 1")
    abort_argument(policy, must, "policy", call)
  }
  policy
}

rows_of_actions <- function(actions, model, arg, call) {
  columns <- action_columns(model, actions)
  count <- as.integer(model$action_space$n)
  known <- columns %in% seq_len(count) & actions == trunc(actions)
  if (length(actions) != length(model$start) || !all(known)) {
    must <- paste("the number of an action for each of", count_of(length(model$start), "state"))
    abort_argument(actions, must, arg, call)
  }
  probabilities <- matrix(0, length(actions), count)
  probabilities[cbind(seq_along(actions), columns)] <- 1
  probabilities
}

# The probability of each action in each state of a model that the policy is bound to.
policy_probabilities <- function(policy, model, call) UseMethod("policy_probabilities")

#' @exportS3Method
policy_probabilities.default <- function(policy, model, call) {
  states <- state_numbers(model$observation_space)
  possible <- rowSums(possible_actions(model)) > 0
  # States without actions are never visited in play.
  asked <- states[possible]
  here <- list(
    observation_space = model$observation_space, action_space = model$action_space,
    spec = model$spec, call = call
  )
  # Twice, with different streams, to see whether it draws.
  ask <- function(seed) {
    as.vector(with_generator(new_generator(seed), act_batch(policy, asked, length(asked), here)))
  }
  actions <- rep(as.integer(model$action_space$start), length(states))
  actions[possible] <- ask(1)
  if (!identical(ask(2), actions[possible])) {
    gym_abort(
      c("The policy draws its actions, so its value cannot be calculated.",
        i = paste("Give the probabilities, a matrix with a row for each state and a column for",
                  "each action, or play it: `rollout()`.")),
      class = c("gym_error_draws", "gym_error_argument"), argument = "policy", value = policy,
      call = call
    )
  }
  rows_of_actions(actions, model, "policy", call)
}

#' @exportS3Method
policy_probabilities.gym_policy_random <- function(policy, model, call) {
  possible <- possible_actions(model)
  possible / pmax(rowSums(possible), 1)
}

#' @exportS3Method
policy_probabilities.gym_policy_table <- function(policy, model, call) {
  table_probabilities(policy)
}
