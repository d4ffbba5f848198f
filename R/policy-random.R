#' Act at random
#'
#' Make a policy that ignores the observation and draws its action from the action space, like
#' Gymnasium's own `sample()`: uniformly between the bounds, from an exponential distribution if one
#' side is unbounded, and from a normal distribution if both are. In a model (see [gym_model()]) it
#' draws among the actions that the state has. With [act()] it draws by R's generator, so
#' [set.seed()] fixes its actions; in [rollout()] its actions follow from `seed`.
#' `random_discrete_agent()` makes such a policy for `n` actions; the name is that of the
#' classic package.
#'
#' @param action_space The space to draw from, such as `gym_make("CartPole-v1")$action_space`.
#'   `NULL`, the default, is the action space of the environment that the policy plays.
#' @param n The number of actions, a whole number of at least 1. The actions are 0, 1, ..., `n` - 1.
#' @return A policy of class `gym_policy_random`, for [act()] and [rollout()].
#' @section Errors: `gym_error_argument` if `action_space` is not a space or `n` is not a whole
#'   number of at least 1; from [act()] if the policy has no action space yet.
#' @seealso [policy_network()]
#' @export
#' @examples
#' agent <- random_discrete_agent(2)
#' agent
#' set.seed(1)
#' act(agent, c(0.01, -0.2, 0.03, 0.4))
#'
#' @examplesIf gym:::can_start_server()
#' rollout("CartPole-v1", policy_random(), episodes = 10, seed = 1)
policy_random <- function(action_space = NULL) {
  if (!is.null(action_space) && !inherits(action_space, "gym_space")) {
    abort_argument(action_space, "a space or NULL", "action_space", rlang::current_env())
  }
  structure(
    list(action_space = action_space, observation_space = NULL),
    class = c("gym_policy_random", "gym_policy")
  )
}

#' @rdname policy_random
#' @export
random_discrete_agent <- function(n) {
  check_count(n)
  policy_random(new_space(list(name = "Discrete", n = as.integer(n), start = 0L)))
}

#' @export
act.gym_policy_random <- function(policy, observation, ...) {
  space <- policy$action_space
  abort_if(
    is.null(space),
    "policy", policy, rlang::current_env(), "The random policy has no action space.",
    i = "Give one, as in `policy_random(env$action_space)`, or play it with `rollout()`."
  )
  n <- count_observed(observation, policy$observation_space)
  if (is.null(n)) space_sample(space) else sample_batch(space, n)
}

# The number of observations; each gets an action. Numbers and the rows of a data frame can be
# counted. A list is one observation of several parts, and so is `NULL`.
count_observed <- function(observation, space) {
  if (!is.null(space) && !is_stackable(space) || is.list(observation)) {
    return(if (is.data.frame(observation)) nrow(observation))
  }
  rows <- observation_rows(observation, space)
  if (!rows$one) nrow(rows$values)
}

#' @exportS3Method
act_batch.gym_policy_random <- function(policy, observation, n, vector_env) {
  possible <- policy$possible
  if (is.null(possible)) {
    return(sample_batch(policy$action_space, n))
  }
  possible <- possible[space_index(policy$observation_space)$index(observation, n), , drop = FALSE]
  draw_by_row(possible / pmax(rowSums(possible), 1)) - 1L + as.integer(policy$action_space$start)
}

#' @exportS3Method
policy_bind.gym_policy_random <- function(policy, env, call = rlang::caller_env()) {
  own <- policy$action_space
  policy$observation_space <- env$observation_space
  if (is.null(own)) {
    policy$action_space <- env$action_space
    # A terminal state has no actions, so the policy does nothing there.
    count <- if (!is.null(env$possible)) rowSums(env$possible)
    policy$possible <- if (any(count > 0 & count < ncol(env$possible))) env$possible
    return(policy)
  }
  # Each action of the policy must be an action of the environment: compare the spaces' kinds and
  # shapes.
  all <- env$action_space
  within <- if (inherits(own, "gym_space_discrete") && inherits(all, "gym_space_discrete")) {
    own$start >= all$start && own$start + own$n <= all$start + all$n
  } else {
    identical(class(own), class(all)) && identical(own$shape, all$shape)
  }
  abort_if(
    !within, "policy", policy, call,
    "The policy's actions are {format(own)}, but {environment_label(env)} takes
     {format(env$action_space)}."
  )
  policy
}

#' @export
format.gym_policy_random <- function(x, ...) {
  if (is.null(x$action_space)) "random" else paste("random over", format(x$action_space))
}
