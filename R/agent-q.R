#' Q-learning
#'
#' Learns the value of each action in each state by moving it, after each step, towards the reward
#' and the value of the best action in the state that the step led to (Watkins 1989; Sutton and
#' Barto 2018, section 6.5).
#'
#' `double = TRUE` keeps two tables, one of which chooses the best action and the other values it,
#' so that luck is not taken for value (van Hasselt 2010; section 6.7). `planning` is how many
#' remembered steps are learned from again after each real one (Dyna-Q; section 8.2), where the last
#' outcome of each state and action is remembered.
#'
#' While it learns it draws among actions with equal values; the policy that it returns takes the
#' first of them. Where the model is known, an action that a state does not have is never taken.
#'
#' Where the model of the environment is known (see [env_model()]) the policy is judged by it,
#' exactly and without playing; the evaluations then have 0 episodes and a standard error of 0.
#'
#' @param discount The discount, a number above 0 and at most 1; the default is 0.99.
#' @param learning_rate How far a value moves towards its target, a number from 0 to 1, or a
#'   function of the steps so far, such as [schedule_linear()]. With tiles the value moves by this,
#'   whatever number of tiles it is made of; with features of a function by this times the sum of
#'   their squares.
#' @param epsilon How often it explores, a number from 0 to 1, or a function of the steps so far.
#' @param temperature The temperature of softmax exploration, in place of `epsilon`, a number above
#'   0 or a function of the steps so far; `NULL`, the default, for none. See [policy_table()].
#' @param initial The value that all actions have at first, a number; a large one makes it try
#'   everything ("optimistic"). The default is 0. With features of a function all weights are 0 at
#'   first.
#' @param features `NULL`, the default, for a table with a row for each state; what [tile_coding()]
#'   makes; or a function of a batch of observations that returns a numeric matrix with a row of
#'   features for each.
#' @param double Double Q-learning? `FALSE`, the default, or `TRUE`.
#' @param planning How many remembered steps to learn from after each real one, a whole number;
#'   tables only. The default is 0.
#' @param mask The name of the element of the environment's info that says which actions can be
#'   taken, such as `"action_mask"` of Taxi: a number for each action, 0 for one that must not be.
#'   What it forbids at an observation is never taken there again, and its value is `-Inf`; tables
#'   only. `NULL`, the default, for none.
#' @param env The environment, as for [train_agent()].
#' @param iterations,total_steps,target The budget and the target, as for [train_agent()]. An
#'   iteration are `episodes` episodes.
#' @param episodes How many episodes make an iteration, a whole number; the default is 10.
#' @param ... Further arguments of [train_agent()], such as `seed` or `num_envs`, and the
#'   environment's own, such as `is_slippery = FALSE`.
#' @return `agent_q()` an agent of class `gym_agent_q`; `learn_q()` makes that agent, trains it and
#'   returns what [train_agent()] does. Its `$policy` takes the action with the largest value, and
#'   [state_values()] gives the values.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, actions that
#'   are not Discrete, or observations that a table has no rows for.
#' @references C. Watkins (1989), Learning from Delayed Rewards, PhD thesis, Cambridge. H. van
#'   Hasselt (2010), Double Q-learning, NeurIPS 23. R. S. Sutton and A. G. Barto (2018),
#'   Reinforcement Learning: An Introduction, second edition, MIT Press.
#' @seealso [learn_sarsa()], [learn_monte_carlo()], [learn_td()]; [agent_observe()] for what a
#'   learner is.
#' @export
#' @examples
#' agent_q(epsilon = schedule_linear(1, 0.05, duration = 5000))
#' @examplesIf gym:::can_start_server()
#' learned <- learn_q("FrozenLake-v1", iterations = 20, seed = 1, is_slippery = FALSE, initial = 1)
#' learned
agent_q <- function(discount = 0.99, learning_rate = 0.1, epsilon = 0.1, temperature = NULL,
                    initial = 0, features = NULL, double = FALSE, planning = 0, mask = NULL) {
  check_flag(double)
  check_count(planning, min = 0)
  settings <- list(
    discount = discount, learning_rate = learning_rate, epsilon = epsilon,
    temperature = temperature, initial = initial, features = features, double = double,
    planning = as.integer(planning), mask = mask
  )
  check_learner(settings)
  if (planning > 0 && (double || !is.null(features))) {
    gym_abort(
      "`planning` is for a single table, not for features or double Q-learning.",
      class = "gym_error_argument", argument = "planning", value = planning
    )
  }
  new_learner("gym_agent_q", settings)
}

#' @export
agent_start.gym_agent_q <- function(agent, policy) {
  agent <- NextMethod()
  agent$second <- if (agent$double) agent$weights
  agent$memory <- list(pair = integer(), outcome = NULL)
  agent
}

#' @export
agent_observe.gym_agent_q <- function(agent, transitions) {
  column <- action_columns(agent$spaces, transitions$action)
  present <- seen_by(agent, transitions$observation, column)
  after <- seen_by(agent, transitions$next_observation, column)
  agent <- with_known_weights(agent, present)
  if (agent$double) {
    return(learn_double(agent, present, column, transitions, after))
  }
  agent <- learn_from(agent, present, column, transitions, row_max(values_of(agent, after)))
  if (agent$planning > 0L) {
    agent <- plan_again(remember(agent, present, column, transitions, after), length(column))
  }
  agent
}

# A coin decides for each transition which of the two tables learns from it.
learn_double <- function(agent, present, column, transitions, after) {
  agent$second <- agent$second %||% agent$weights
  first <- stats::runif(length(column)) < 0.5
  rate <- scheduled(agent$learning_rate, agent$taken, "learning_rate")
  learns <- function(own, choosing, valuing) {
    if (!any(own)) {
      return(choosing)
    }
    n <- sum(own)
    best <- best_column(values_of(agent, after[own, , drop = FALSE], choosing))
    ahead <- values_of(agent, after[own, , drop = FALSE], valuing)[cbind(seq_len(n), best)]
    ahead[transitions$terminated[own]] <- 0
    there <- present[own, , drop = FALSE]
    value <- values_of(agent, there, choosing)[cbind(seq_len(n), column[own])]
    error <- transitions$reward[own] + agent$discount * ahead - value
    move_weights(agent$basis, choosing, there, column[own], rate, error)
  }
  weights <- agent$weights
  agent$weights <- learns(first, weights, agent$second)
  agent$second <- learns(!first, agent$second, weights)
  agent$taken <- agent$taken + length(column)
  agent
}

# Keeps the last outcome of each state and action.
remember <- function(agent, present, column, transitions, after) {
  count <- nrow(agent$weights)
  pair <- present[, 1L] + count * (column - 1L)
  memory <- agent$memory
  if (is.null(memory$outcome)) {
    memory$outcome <- matrix(NA_real_, length(agent$weights), 3L)
  }
  new <- unique(pair[is.na(memory$outcome[pair, 1L])])
  memory$pair <- c(memory$pair, new)
  memory$outcome[pair, ] <- cbind(transitions$reward, after[, 1L], transitions$terminated)
  agent$memory <- memory
  agent
}

# Learns from remembered steps, as many at a time as there were real ones.
plan_again <- function(agent, n) {
  taken <- agent$taken
  count <- nrow(agent$weights)
  for (again in seq_len(agent$planning)) {
    # No steps of the environment: schedules stay where they are.
    agent$taken <- taken
    pair <- agent$memory$pair[sample.int(length(agent$memory$pair), n, replace = TRUE)]
    outcome <- agent$memory$outcome[pair, , drop = FALSE]
    ahead <- row_max(values_of(agent, outcome[, 2L, drop = FALSE]))
    agent <- learn_from(
      agent, matrix((pair - 1L) %% count + 1L, n, 1L), (pair - 1L) %/% count + 1L,
      list(reward = outcome[, 1L], terminated = outcome[, 3L] == 1), ahead
    )
  }
  agent$taken <- taken
  agent
}

#' @exportS3Method
action_weights.gym_agent_q <- function(agent) {
  if (agent$double && !is.null(agent$second)) (agent$weights + agent$second) / 2 else agent$weights
}

#' @export
format.gym_agent_q <- function(x, ...) {
  name <- if (x$double) "Double Q-learning" else if (x$planning > 0L) "Dyna-Q" else "Q-learning"
  learner_text(name, x, if (x$planning > 0L) list(planning = x$planning))
}

#' @rdname agent_q
#' @export
learn_q <- function(env, iterations = NULL, total_steps = NULL, target = NULL, episodes = 10,
                    discount = 0.99, learning_rate = 0.1, epsilon = 0.1, temperature = NULL,
                    initial = 0, features = NULL, double = FALSE, planning = 0, mask = NULL, ...) {
  make_and_train("agent_q", rlang::current_env(), ...)
}
