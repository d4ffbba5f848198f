# Policies that play whole episodes in a program of their own, which also makes the environment,
# such as those that stay with Stable-Baselines3.

#' Play whole episodes with a policy that has a program of its own
#'
#' @param policy The policy, bound to the environment.
#' @param vector_env As passed on by [with_vector_env()].
#' @param episodes A list of vectors with an element for each episode, as for [play_batch()].
#' @param keep What to keep of the steps, a character vector of `"steps"` and `"next_observation"`.
#' @param report A function that is called with the number of finished episodes.
#' @return A list: `batch`, as returned by [play_batch()], for the first episodes or all; and what
#'   ended it early, if anything did: `error`, a condition, or `interrupted`.
#' @noRd
play_whole <- function(policy, vector_env, episodes, max_steps, keep, report) {
  UseMethod("play_whole")
}

plays_apart <- function(policy) {
  if (inherits(policy, "gym_policy_list")) {
    any(vapply(unclass(policy), plays_apart, NA))
  } else {
    has_method(policy, "play_whole")
  }
}

# The environment with the observation space of the policy, which wrappers may have changed.
seen_by <- function(policy, vector_env) {
  first <- policy_subset(policy, 1L)
  if (!is.null(first$observation_space)) vector_env$observation_space <- first$observation_space
  vector_env
}

# One candidate after the other.
play_apart <- function(vector_env, history, policy_of, report, max_steps, keep_steps,
                       keep_next = FALSE) {
  keep <- c("steps", "next_observation")[c(keep_steps, keep_next)]
  listed <- list_episodes(list(num_envs = 1L), history, Inf)
  for (candidate in seq_len(history$candidates)) {
    policy <- policy_of(candidate)
    check_plays_apart(policy, vector_env)
    own <- lapply(listed, `[`, listed$candidate == candidate)
    played <- play_whole(policy, vector_env, own, max_steps, keep, report)
    if (length(played$batch$return)) suspendInterrupts(enter_batch(history, played$batch))
    if (!is.null(played$error)) rlang::cnd_signal(played$error)
    if (played$interrupted) rlang::interrupt()
  }
}

check_plays_apart <- function(policy, vector_env) {
  abort_if(
    !plays_apart(policy), "policy", NULL, vector_env$call,
    "A policy that plays in a process of its own cannot be played together with
     {policy_text(policy)}.",
    i = "Play each in a call of its own, with the same `seed`."
  )
}
