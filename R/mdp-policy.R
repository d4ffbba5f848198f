# Policies in a model: the probability of each action in each state.

#' Compute the probabilities with which a policy acts
#'
#' @param policy As for [solve_mdp()].
#' @return A matrix with a row for each state and a column for each action.
#' @noRd
policy_matrix <- function(policy, model, call) {
  possible <- possible_actions(model)
  if ((is.character(policy) || is.factor(policy)) && !is.null(model$action_space$values)) {
    policy <- stats::setNames(
      encoded_values(model$action_space, policy, "action", call), names(policy)
    )
  }
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
    abort_wrong(
      "policy", policy, call,
      "The policy takes action {value_labels(model$action_space)[[at[[2L]]]]} in state
       {value_labels(model$observation_space)[[at[[1L]]]]}, where the model does not have that
       action."
    )
  }
  probabilities[barred] <- 0
  probabilities
}

# Sorts actions, or the rows and columns of probabilities, by their names into the order of the
# model.
in_model_order <- function(policy, model, call) {
  states <- names(model$start)
  order_of <- function(given, forms, what, labels) {
    places_of_names(given, forms, labels) %||% abort_wrong(
      "policy", policy, call,
      "The names of `policy` must be those of the {what}, {few_names(forms[[1L]])}, not
       {few_names(given)}.",
      i = "Without names it is taken in their order: `unname()` removes them."
    )
  }
  if (!is.matrix(policy)) {
    return(unname(policy[order_of(names(policy), list(states), "states", FALSE)]))
  }
  actions <- value_labels(model$action_space)
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
  one_hot(columns, count)
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
  # Ask twice, with different random numbers, to see whether the policy draws.
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

# Their returns, exactly ---------------------------------------------------------------

#' Evaluate policies exactly
#'
#' Compute the expected return of a policy from the model of the environment, instead of playing.
#' Nothing is random, and there is no interval.
#'
#' @inheritParams solve_mdp
#' @param env A model, see [gym_model()] and [env_model()].
#' @param policy The policy, as for [solve_mdp()], or a list of several.
#' @param max_steps The number of steps after which episodes are cut off, a whole number. `NULL`,
#'   the default, uses the model's own limit. Without a limit, or with `Inf`, episodes go on until
#'   they terminate.
#' @param ... Must be empty.
#' @return A data frame with a row for each policy and the columns `candidate` (its number, an
#'   integer), `mean_return` and `mean_length` (doubles: the expected return, and the expected
#'   number of steps) and `max_steps` (double, `Inf` for no limit). Names of policies in a list
#'   become row names.
#' @section Errors: `gym_error_argument` for a policy that does not fit the model.
#' @seealso [evaluate_policy()], which plays; [solve_mdp()] for the value of each state
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' evaluate_policy(walk, list(random = policy_random(), right = c(1, 1, 1, 1)))
#'
#' @examplesIf gym:::can_start_server()
#' lake <- env_model("FrozenLake-v1")
#' evaluate_policy(lake, solve_mdp(lake)$policy)
evaluate_policy.gym_model <- function(env, policy, ..., max_steps = NULL, discount = 1) {
  check_dots_empty(...)
  check_discount(discount)
  if (!identical(max_steps, Inf)) check_count(max_steps, allow_null = TRUE)
  call <- rlang::current_env()
  backup <- backup_of(env, call)
  limit <- max_steps %||% env$spec$max_episode_steps %||% Inf
  several <- is.list(policy) && !is.object(policy)
  policies <- if (several) policy else list(policy)
  if (!length(policies)) {
    abort_argument(policy, "a policy, or a list of at least one", "policy", call)
  }
  # To compute lengths, let each step have the reward 1.
  counting <- backup
  counting$expected <- rep(1, length(backup$expected))
  rows <- lapply(seq_along(policies), function(i) {
    probabilities <- policy_matrix(policies[[i]], env, call)
    data.frame(
      candidate = i,
      mean_return = expected_return(env, backup, probabilities, limit, discount, call),
      mean_length = expected_return(env, counting, probabilities, limit, 1, call),
      max_steps = as.double(limit)
    )
  })
  evaluated <- do.call(rbind, rows)
  if (!is.null(names(policies))) row.names(evaluated) <- make.unique(names(policies))
  evaluated
}

expected_return <- function(model, backup, probabilities, limit, discount, call) {
  start_mean(model, limited_values(backup, probabilities, limit, discount, call))
}

limited_values <- function(backup, probabilities, limit, discount, call) {
  if (limit == Inf) {
    return(policy_values(backup, probabilities, discount, call)$values)
  }
  moves <- policy_moves(backup, probabilities)
  sorted <- order(moves$from, method = "radix")
  ahead <- padded_product(
    moves$from[sorted], moves$to[sorted], discount * moves$weight[sorted], backup$states
  )
  reward <- mean_values(array(backup$expected, dim(probabilities)), probabilities)
  values <- numeric(backup$states)
  for (sweep in seq_len(limit)) {
    new <- reward + ahead(values)
    # From here on all sweeps give the same values.
    if (identical(new, values)) break
    values <- new
  }
  values
}
