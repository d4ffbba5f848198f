# Episodes are played in batches: each sub-environment plays one episode of a batch. A
# sub-environment whose episode has ended waits for the end of the batch. If it began another
# episode at once, and playing stopped at the number of episodes asked for, short episodes would be
# favoured.

#' Make an empty history of episodes
#'
#' @param wanted How many episodes, from the first, are to be played.
#' @param on_end A function that is called when episodes have ended, with the history, the numbers
#'   of these episodes and their returns. It may lower `wanted` in the history.
#' @return A history, an environment: `wanted`; `begun`, how many episodes have begun;
#'   `batches`, a list of environments, one for each batch, see [new_batch()]; `after_batch`, a
#'   function that is called with the history when a batch has ended.
#' @noRd
new_history <- function(wanted, on_end = function(history, episodes, returns) NULL) {
  rlang::env(
    wanted = wanted, begun = 0L, batches = list(), on_end = on_end,
    after_batch = function(history) NULL
  )
}

#' Play batches of episodes until all that are wanted have ended
#'
#' @param vector_env As [vector_env_of()] returns it.
#' @param history As [new_history()] returns it. It holds what was played also when an error or an
#'   interrupt ends the playing.
#' @param begin A function of the number of a batch and the numbers of its episodes. It returns a
#'   list of `seeds`, as `vector_env$draw_seeds()` draws them, and `policy`, which plays the batch.
#' @param max_steps After how many steps an episode is cut short, `NULL` for no limit.
#' @param keep_steps Whether to keep each step in the history.
#' @noRd
play_episodes <- function(vector_env, history, begin, max_steps = NULL, keep_steps = FALSE) {
  while (history$begun < history$wanted) {
    n <- as.integer(min(vector_env$batch_size, history$wanted - history$begun))
    batch <- length(history$batches) + 1L
    begun <- begin(batch, history$begun + seq_len(n))
    history$batches[[batch]] <- new_batch(history$begun + seq_len(n), begun$seeds)
    history$begun <- history$begun + n
    play_batch(
      vector_env, history$batches[[batch]], begun$policy, history, max_steps %||% Inf, keep_steps
    )
    history$after_batch(history)
  }
}

# What is known of the episodes of a batch: `episodes`, their numbers; `seeds`, those that the
# sub-environments are reset with, of which more may be than play; and vectors with an element for
# each episode.
new_batch <- function(episodes, seeds) {
  n <- length(episodes)
  rlang::env(
    episodes = episodes, seeds = seeds, seed = seeds[seq_len(n)], sub_env = seq_len(n),
    return = numeric(n), length = integer(n), terminated = logical(n), truncated = logical(n),
    steps = list(), frames = list()
  )
}

# All episodes of a batch begin together. So all that are still playing have taken the same number
# of steps, which is `taken`.
play_batch <- function(vector_env, batch, policy, history, max_steps, keep_steps) {
  playing <- batch$sub_env
  observation <- batch_rows(vector_env$observation_space, vector_env$reset(batch$seeds), playing)
  keep_frame(batch, vector_env)
  if (batch$episodes[[1L]] == 1L) {
    ask_beforehand(policy, observation, playing, vector_env)
  }
  returns <- numeric(length(playing))
  taken <- 0L
  while (length(playing)) {
    action <- act_batch(policy, observation, playing, vector_env)
    out <- vector_env$step(action, playing)
    taken <- taken + 1L
    keep_frame(batch, vector_env)
    returns <- returns + out$reward
    if (keep_steps) {
      batch$steps[[taken]] <- list(
        sub_env = playing, observation = observation, action = action, reward = out$reward,
        terminated = out$terminated, truncated = out$truncated
      )
    }
    observation <- out$observation
    ended <- out$terminated | out$truncated | taken >= max_steps
    if (any(ended)) {
      end_episodes(batch, playing[ended], returns[ended], taken, lapply(out[flags], `[`, ended))
      history$on_end(history, batch$episodes[playing[ended]], returns[ended])
      going <- which(!ended & batch$episodes[playing] <= history$wanted)
      playing <- playing[going]
      returns <- returns[going]
      observation <- batch_rows(vector_env$observation_space, observation, going)
    }
  }
}

# Frames are kept of environments without sub-environments only: each of their batches is one
# episode.
keep_frame <- function(batch, vector_env) {
  if (!is.null(vector_env$frame)) {
    batch$frames[[length(batch$frames) + 1L]] <- vector_env$frame()
  }
}

# An episode that the environment neither terminated nor truncated was cut short by `max_steps`,
# which counts as truncated.
end_episodes <- function(batch, sub_env, returns, length, out) {
  batch$return[sub_env] <- returns
  batch$length[sub_env] <- length
  batch$terminated[sub_env] <- out$terminated
  batch$truncated[sub_env] <- out$truncated | !out$terminated
}
