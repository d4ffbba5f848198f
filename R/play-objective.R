#' The return of a policy as a function of its weights
#'
#' Make a function for optimisers such as [stats::optim()], which minimise. It plays the policy with
#' a vector of weights and returns minus its mean return. It plays the same episodes each time, so
#' equal weights have equal values.
#'
#' @inheritParams evaluate_policy
#' @param policy The policy whose weights are the argument: a network, by default [policy_linear()].
#'   Its moments of observations do not change.
#' @param episodes The number of episodes for a mean, a whole number of at least 1. The default
#'   is 10.
#' @param seed A whole number that fixes the episodes. `NULL`, the default, draws one, once.
#' @return A function of class `gym_objective`. Its argument `weights` is a numeric vector in the
#'   order of [coef()][coef.gym_policy_network], or a matrix with the weights of a candidate in each
#'   row, which are played together. It returns minus the mean return of each, a numeric vector. Its
#'   attribute `policy` is the policy, bound to the environment: `coef(attr(f, "policy"))` are
#'   weights to start with.
#' @section Errors: As for [rollout()]. The function raises a `gym_error_argument` for a wrong
#'   number of weights.
#' @seealso [train_agent()], [evaluate_policy()]
#' @export
#' @examplesIf gym:::can_start_server()
#' objective <- gym_objective("CartPole-v1", episodes = 5, seed = 1)
#' objective(c(0, 0, 1, 1))
#' objective(rbind(left = c(0, 0, -1, 0), right = c(0, 0, 1, 1)))
#'
#' set.seed(1)
#' start <- coef(attr(objective, "policy"))
#' found <- optim(start, objective, method = "SANN", control = list(maxit = 20))
#' found$value
#' policy <- attr(objective, "policy")
#' coef(policy) <- found$par
gym_objective <- function(env, policy = policy_linear(), episodes = 10, seed = NULL, ...,
                          max_steps = NULL, num_envs = NULL, client = gym_client(),
                          num_workers = NULL) {
  match_whole_names()
  call <- rlang::current_env()
  check_environment(env)
  check_count(episodes)
  check_seed(seed)
  if (!inherits(policy, "gym_policy_network")) {
    abort_no_weights(policy, "policy", call)
  }
  seed <- seed %||% draw_seed()
  in_env <- function(episodes, play) {
    with_vector_env(env = env, episodes = episodes, play = play, max_steps = max_steps, ...,
                    num_envs = num_envs, num_workers = num_workers, client = client, seed = seed,
                    call = call)
  }
  policy <- in_env(1, function(vector_env) policy_bind(policy, vector_env, call = call))
  played <- same_episodes(seed, as.integer(episodes), max_steps)
  objective <- function(weights) {
    candidates <- naming_own_call(
      policy_candidates(policy, if (is.matrix(weights)) weights else rbind(weights)),
      "policy_candidates"
    )
    count <- nrow(candidates$weights)
    -in_env(count * episodes, function(vector_env) played(vector_env, candidates, count))
  }
  structure(objective, policy = policy, class = c("gym_objective", "function"))
}

# Returns a function that plays the same episodes with each candidate and returns the mean returns.
# It must not draw random numbers: optim(method = "SANN") draws in C and would go on from the same
# state each time.
same_episodes <- function(seed, episodes, max_steps) {
  streams <- new_streams(seed)
  seeds <- with_generator(streams$seeds, draw_environment_seeds(episodes))
  kept <- saved_streams(streams)
  play <- function(vector_env, candidates, which) {
    history <- new_history(length(which), episodes, restore_streams(kept), common_seeds = TRUE)
    taken <- 0L
    history$draw_seeds <- function(n) {
      taken <<- taken + n
      seeds[taken - n + seq_len(n)]
    }
    play_batches(
      vector_env, history, function(these) policy_subset(candidates, which[these]),
      max_steps = max_steps %||% Inf
    )
    colMeans(matrix(episode_results(history)$returns, episodes))
  }
  function(vector_env, candidates, count) {
    # If R steps sub-environments that share a seed, candidates played together would play different
    # episodes.
    if (has_common_seeds(env_for_policy(vector_env, candidates, max_steps %||% Inf))) {
      play(vector_env, candidates, seq_len(count))
    } else {
      vapply(seq_len(count), function(one) play(vector_env, candidates, one), 0)
    }
  }
}

#' @export
print.gym_objective <- function(x, ...) {
  policy <- attr(x, "policy")
  cat("<objective: minus the mean return of ", format(policy), " in ", env_text(policy), ">\n",
      sep = "")
  invisible(x)
}
