#' Evaluate policies exactly
#'
#' Compute the expected return of a policy from the model of the environment, instead of playing.
#' Nothing is random, and there is no interval.
#'
#' @inheritParams solve_mdp
#' @param env A model, see [gym_model()] and [env_model()].
#' @param policy The policy, as for [solve_mdp()], or a list of several.
#' @param max_steps The number of steps after which episodes are cut off, a whole number. `NULL`,
#'   the default, uses the model's own limit. Without a limit, or with `Inf`, episodes go on to
#'   their end.
#' @param ... Must be empty.
#' @return A data frame with a row for each policy and the columns `candidate` (its number, an
#'   integer), `mean_return` and `mean_length` (doubles: the expected return, and the expected
#'   number of steps) and `max_steps` (double, `Inf` for no limit). Names of policies in a list
#'   become row names.
#' @section Errors: `gym_error_argument` for a policy that does not fit.
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
  # Each step counts 1 instead of its reward.
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

# One sweep costs as much as the policy has moves: each row of the matrices has those of a state.
limited_values <- function(backup, probabilities, limit, discount, call) {
  if (limit == Inf) {
    return(policy_values(backup, probabilities, discount, call)$values)
  }
  moves <- policy_moves(backup, probabilities)
  sorted <- order(moves$from, method = "radix")
  from <- moves$from[sorted]
  place <- sequence(rle(from)$lengths)
  next_state <- array(1L, c(backup$states, max(place, 1L)))
  weight <- array(0, dim(next_state))
  next_state[cbind(from, place)] <- moves$to[sorted]
  weight[cbind(from, place)] <- discount * moves$weight[sorted]
  reward <- mean_values(array(backup$expected, dim(probabilities)), probabilities)
  values <- numeric(backup$states)
  for (sweep in seq_len(limit)) {
    ahead <- reward + .rowSums(weight * values[next_state], nrow(weight), ncol(weight))
    # From here on all sweeps give the same values.
    if (identical(ahead, values)) break
    values <- ahead
  }
  values
}
