#' Solve a model
#'
#' Find the best policy of a model and compute the value of each state exactly. With `policy`,
#' compute the values of this policy instead.
#'
#' # Which value
#'
#' If an environment has a step limit, its value can mean three things. The result prints the values
#' of the start that were computed:
#'
#' - The value without the limit, as if episodes were never truncated. `solve_mdp(model)` computes
#'   it.
#' - The value of the same policy with the model's limit, `max_episode_steps`: the expected return
#'   in play.
#' - The value of the best policy that also counts the steps and acts differently near the limit.
#'   `solve_mdp(model, horizon = )` computes it, and no policy achieves more.
#'
#' Gymnasium's observations do not include the number of steps, so a learned policy depends only on
#' the state. The value of the best such policy is between the second value and the third. No method
#' here is certain to find this policy.
#'
#' # Methods
#'
#' Value iteration applies Bellman's equation to all states together until the values do not change
#' any more, or 20,000 times. Policy iteration then starts from the resulting policy, which is
#' usually the best one already. Policy iteration alternates between computing the values of a
#' policy and improving the policy. It computes values by sweeps if a few are enough. Otherwise it
#' solves the policy's linear equations, with sparse matrices if there are more than 500 states.
#' Without a discount two kinds of states are special. A state that can stay where it is forever
#' without a reward has a value of at least 0. A state from which no policy is sure to end an
#' episode has the value `-Inf`.
#'
#' Two actions count as equal if their values differ by less than 1e-12 of the size of the rewards
#' that were added up. Equal actions are common with a discount of 1, and some of them may lead in
#' circles forever. The policy takes those that end episodes in the fewest steps.
#'
#' @param model A model, see [gym_model()], or an environment that has one, as for [env_model()].
#' @param policy The policy to evaluate: a [policy_table()]; [policy_random()]; any other policy
#'   that draws no random numbers; a vector with the number of an action for each state; or a matrix
#'   of probabilities with a row for each state and a column for each action. `NULL`, the default,
#'   finds the best policy.
#' @param discount The factor by which a reward counts less with each step, a number above 0 and at
#'   most 1, the default.
#' @param horizon The number of steps after which everything ends, a whole number. `NULL`, the
#'   default, sets no horizon.
#' @param method `"value_iteration"`, the default, or `"policy_iteration"`. Ignored with a policy or
#'   a horizon.
#' @param trace Keep the values after each sweep? `FALSE`, the default, or `TRUE`.
#' @return An object of class `gym_solution`, with methods for [print()], [as.data.frame()],
#'   [predict()] and [plot()][plot.gym_solution()]. It is a list with the elements
#'   \describe{
#'     \item{values}{The value of each state, a numeric vector with the states' numbers or names as
#'       names. With a horizon, it is the value before the first step.}
#'     \item{q}{The value of each action in each state, a matrix with a row for each state and a
#'       column for each action; `-Inf` for an invalid action.}
#'     \item{actions}{The numbers of the best actions, an integer vector; with a horizon, a matrix
#'       with a column for each step, in order. If actions have names, `as.data.frame()` shows them.
#'       `NA` for a terminal state, or any other state without actions. `NULL` if `policy` was
#'       given.}
#'     \item{policy}{The best policy, a [policy_table()], or the given one. `NULL` with a horizon,
#'       because then the best policy counts steps.}
#'     \item{start_value}{The value of the start, a number: the mean value over the starting
#'       states.}
#'     \item{limited}{The value of the start if the policy's episodes are cut off after the model's
#'       `max_episode_steps`, a number. `NULL` without such a limit or with a horizon.}
#'     \item{trace}{The values after each sweep, a matrix with a row for each sweep. The first row
#'       has the initial values, 0. `NULL` without `trace = TRUE`.}
#'     \item{model, discount, horizon, method, sweeps}{The arguments, and the number of sweeps.}
#'   }
#' @section Errors: `gym_error_argument` for an invalid argument, for a model whose values are
#'   infinite, and for a model that is too large for the memory. Values can be infinite if there is
#'   neither a discount below 1 nor a horizon, and episodes or rewards go on forever. The size of a
#'   model is the number of states times actions times transitions of each.
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press, chapter 4.
#' @seealso [evaluate_policy()][evaluate_policy.gym_model()], which evaluates several policies by a
#'   model
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' solve_mdp(walk)
#' solve_mdp(walk, policy = policy_random())$values
#'
#' @examplesIf gym:::can_start_server()
#' solved <- solve_mdp("FrozenLake-v1")
#' solved
#' plot(solved)
#' solve_mdp("FrozenLake-v1", horizon = 100)
solve_mdp <- function(model, policy = NULL, discount = 1, horizon = NULL,
                      method = c("value_iteration", "policy_iteration"), trace = FALSE) {
  model <- as_model(model)
  check_discount(discount)
  check_count(horizon, allow_null = TRUE)
  method <- check_choice(method[1L], c("value_iteration", "policy_iteration"), arg = "method")
  check_flag(trace)
  call <- rlang::current_env()
  backup <- backup_of(model, call)
  probabilities <- if (!is.null(policy)) policy_matrix(policy, model, call)
  swept <- if (trace) list(numeric(backup$states))
  see <- function(values) if (trace) swept[[length(swept) + 1L]] <<- values
  found <- if (!is.null(horizon)) {
    solve_horizon(backup, horizon, discount, probabilities, see, call)
  } else if (!is.null(policy)) {
    values <- policy_values(backup, probabilities, discount, call)$values
    list(values = values, sweeps = 0L)
  } else {
    best_endless_values(backup, discount, method, see, call)
  }
  abort_if(
    is.null(policy) && !is.finite(start_mean(model, found$values)), "discount", 1, call,
    "Episodes of {model$spec$id} never end, and without a discount their values are infinite.",
    i = "Give a `discount` below 1, or a `horizon`."
  )
  new_solution(model, backup, found, policy, probabilities, discount, horizon, method,
               if (trace) do.call(rbind, swept))
}

check_discount <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!is_number(x) || x <= 0 || x > 1) {
    abort_argument(x, "a number above 0 and at most 1", arg, call)
  }
}

#' Compute the values of a policy, or the best values, for a number of steps
#' @param see A function that is called with the values after each sweep.
#' @noRd
solve_horizon <- function(backup, horizon, discount, probabilities, see, call) {
  best <- is.null(probabilities)
  if (best) {
    check_fits_memory(as.double(horizon) * backup$states, "Keeping the action of each step", call)
  }
  values <- sizes <- numeric(backup$states)
  choices <- vector("list", horizon)
  # Go backwards from the last step, so the last sweep gives the values of the first step.
  for (step in rev(seq_len(horizon))) {
    q <- action_values(backup, values, discount)
    values <- if (best) best_values(q) else mean_values(q, probabilities)
    see(values)
    if (best) {
      sizes <- pmax(sizes, abs(values))
      choices[[step]] <- first_of(tied_actions(q, sizes))
    }
  }
  list(values = values, sweeps = horizon, q = q, choice = do.call(cbind, choices))
}

new_solution <- function(model, backup, found, policy, probabilities, discount, horizon, method,
                         trace) {
  q <- found$q %||% action_values(backup, found$values, discount)
  first_action <- as.integer(model$action_space$start)
  actions <- NULL
  if (is.null(policy)) {
    actions <- found$choice + first_action - 1L
    # A terminal state has no action.
    actions[rowSums(possible_of(backup)) == 0] <- NA
    if (is.null(horizon)) {
      probabilities <- choice_probabilities(backup, found$choice)
      # In a state without actions, any number will do.
      taken <- probabilities
      taken[rowSums(taken) == 0, 1L] <- 1
      policy <- policy_bind(policy_table(taken), model)
    }
  }
  limit <- model$spec$max_episode_steps
  limited <- if (!is.null(limit) && is.null(horizon)) {
    expected_return(model, backup, probabilities, limit, discount, NULL)
  }
  structure(
    list(
      values = stats::setNames(found$values, names(model$start)),
      q = array(q, dim(q), list(names(model$start), value_labels(model$action_space))),
      actions = actions, policy = if (is.null(horizon)) policy,
      start_value = start_mean(model, found$values), limited = limited,
      trace = trace, model = model, discount = discount, horizon = horizon,
      method = if (is.null(policy) && is.null(horizon) || !is.null(actions)) method,
      sweeps = as.integer(found$sweeps)
    ),
    class = "gym_solution"
  )
}

start_mean <- function(model, values) {
  starts <- model$start > 0
  sum(model$start[starts] * values[starts])
}

# Methods -----------------------------------------------------------------------------

#' @export
print.gym_solution <- function(x, ...) {
  how <- if (is.null(x$actions)) {
    "the policy's values"
  } else if (!is.null(x$horizon)) {
    "the best policy that counts steps"
  } else {
    paste0("by ", sub("_", " ", x$method), ", ", count_of(x$sweeps, "sweep"))
  }
  rows <- c(stats::setNames(x$start_value, solution_meaning(x)))
  if (!is.null(x$limited)) {
    limit <- x$model$spec$max_episode_steps
    rows[[paste("the same policy, cut off after", count_of(limit, "step"))]] <- x$limited
  }
  print_lines(x, c(
    paste0("Solution of ", x$model$spec$id, ": ", count_of(length(x$values), "state"), ", ",
           count_of(ncol(x$q), "action"), ", discount ", number_text(x$discount), " (", how, ")"),
    "Value of the start:",
    paste0("  ", format(names(rows)), "  ", vapply(rows, format, "", digits = 6L))
  ))
}

solution_meaning <- function(x) {
  if (is.null(x$horizon)) {
    "infinite horizon"
  } else if (is.null(x$actions)) {
    paste("the policy, within", count_of(x$horizon, "step"))
  } else {
    paste("within", count_of(x$horizon, "step"), "by a policy that counts them")
  }
}

#' @export
as.data.frame.gym_solution <- function(x, row.names = NULL, optional = FALSE, ...) {
  numbers <- if (is.null(x$actions)) rep(NA, length(x$values)) else as.matrix(x$actions)[, 1L]
  data.frame(
    all_values(x$model$observation_space), value = unname(x$values),
    decoded_actions(x$model$action_space, as.integer(numbers)), row.names = row.names,
    check.names = FALSE
  )
}

#' @export
predict.gym_solution <- function(object, newdata, ...) {
  abort_if(
    is.null(object$policy), "object", object, rlang::current_env(),
    "The policy of a solution with a horizon depends on the step, not only on the state.",
    i = "Its element `actions` has an action for each state and step."
  )
  act(object$policy, newdata)
}
