# A batch of episodes is played by a function that changes nothing: what comes of it depends on the
# environment, the policy, the seeds and the random stream alone. So a batch that was lost can be
# played again, and it does not matter in which order batches are played, and by whom.
#
# Each sub-environment plays one episode at a time, and one whose episode has ended waits for the
# others. If it began another episode at once, and playing stopped at the number of episodes asked
# for, short episodes would be favoured.

#' Play a batch of episodes
#'
#' Draws from the batch's own stream; the session's generator stays as it was. An error or an
#' interrupt ends it without a result.
#' @param vector_env As [as_vector_env()] returns it.
#' @param policy The policy, bound to the environment: one, or several candidates.
#' @param episodes A list of vectors with an element for each episode: `candidate` (which of the
#'   policies plays it), `episode` (its number among those of the candidate) and `seed`.
#' @param stream The stream that the policy draws from.
#' @param max_steps After how many steps an episode is cut short.
#' @param target The mean return of a candidate that makes later candidates needless, `NULL` for
#'   none; `each`, how many episodes a candidate plays.
#' @param keep_steps,keep_next Whether to keep each step, and the observation after it.
#' @param report A function that is called with how many episodes have ended so far.
#' @return A list of vectors with an element for each episode: those of `episodes`, `sub_env`,
#'   `return`, `length`, `terminated`, `truncated`; and the lists `steps` and `frames`. Candidates
#'   after one that has reached the target are left out.
#' @noRd
play_batch <- function(vector_env, policy, episodes, stream, max_steps = Inf, target = NULL,
                       each = 1L, keep_steps = FALSE, keep_next = FALSE,
                       report = function(ended) NULL) {
  n <- length(episodes$episode)
  sub_env <- (seq_len(n) - 1L) %% vector_env$num_envs + 1L
  batch <- rlang::env(
    candidate = episodes$candidate, episode = episodes$episode, seed = episodes$seed,
    sub_env = sub_env, return = numeric(n), length = integer(n), terminated = logical(n),
    truncated = logical(n), ended = logical(n), needed = rep(TRUE, n), steps = list(),
    frames = list(), target = target, each = each, report = report
  )
  play <- function() {
    for (first in which(sub_env == 1L)) {
      numbers <- seq(first, min(n, first + vector_env$num_envs - 1L))
      numbers <- numbers[batch$needed[numbers]]
      if (length(numbers)) {
        play_side_by_side(vector_env, batch, numbers, policy, max_steps, keep_steps, keep_next)
      }
    }
  }
  with_generator(new_generator(stream = stream), naming_call(play(), vector_env))
  columns <- c("candidate", "episode", "seed", "sub_env", "return", "length", "terminated",
               "truncated")
  c(lapply(mget(columns, batch), `[`, batch$needed), mget(c("steps", "frames"), batch))
}

# An error of the environment names the user's call, not the step that was taken for it.
naming_call <- function(code, vector_env) {
  withCallingHandlers(
    code,
    gym_error = function(cnd) {
      if (is.null(cnd$call) || identical(cnd$call[[1L]], quote(vector_env$step))) {
        cnd["call"] <- list(rlang::error_call(vector_env$call))
        rlang::cnd_signal(cnd)
      }
    }
  )
}

# Plays some episodes of a batch, one in each sub-environment. They begin together, so that all that
# are still playing have taken the same number of steps, which is `taken`.
play_side_by_side <- function(vector_env, batch, playing, policy, max_steps, keep_steps,
                              keep_next) {
  space <- vector_env$observation_space
  observation <- begin_episodes(vector_env, batch, playing)
  keep_frame(batch, vector_env, playing)
  if (batch$episode[[playing[[1L]]]] == 1L) {
    ask_beforehand(policy, batch$candidate[playing], observation, vector_env)
  }
  which <- batch$sub_env[playing]
  acting <- policy_rows(policy, batch$candidate[playing])
  returns <- numeric(length(playing))
  taken <- 0L
  repeat {
    action <- act_batch(acting, observation, length(playing), vector_env)
    out <- vector_env$step(action, which)
    taken <- taken + 1L
    keep_frame(batch, vector_env, playing)
    returns <- returns + out$reward
    if (keep_steps) {
      batch$steps[[length(batch$steps) + 1L]] <- list(
        at = playing, observation = observation, action = action, reward = out$reward,
        terminated = out$terminated, truncated = out$truncated,
        next_observation = if (keep_next) out$next_observation
      )
    }
    observation <- out$observation
    ended <- out$terminated | out$truncated | taken >= max_steps
    if (any(ended)) {
      end_episodes(batch, playing[ended], returns[ended], taken, lapply(out[flags], `[`, ended))
      going <- which(!ended & batch$needed[playing])
      if (!length(going)) {
        return(invisible())
      }
      playing <- playing[going]
      which <- which[going]
      returns <- returns[going]
      observation <- batch_rows(space, observation, going)
      acting <- policy_rows(policy, batch$candidate[playing])
    }
  }
}

# Resets the sub-environments of the episodes that begin. Where all must be reset together, those
# that play none are left out of what it returns.
begin_episodes <- function(vector_env, batch, playing) {
  seeds <- batch$seed[playing]
  sub_envs <- batch$sub_env[playing]
  if (vector_env$one_seed) {
    batch_rows(vector_env$observation_space, vector_env$reset(seeds[[1L]]), sub_envs)
  } else {
    vector_env$reset(seeds, sub_envs)
  }
}

# Frames are kept where there is one sub-environment, which plays one episode after the other.
keep_frame <- function(batch, vector_env, playing) {
  if (!is.null(vector_env$frame)) {
    frames <- if (length(batch$frames) >= playing) batch$frames[[playing]]
    batch$frames[[playing]] <- c(frames, list(vector_env$frame()))
  }
}

# An episode that the environment neither terminated nor truncated was cut short by `max_steps`,
# which counts as truncated.
end_episodes <- function(batch, at, returns, length, out) {
  batch$return[at] <- returns
  batch$length[at] <- length
  batch$terminated[at] <- out$terminated
  batch$truncated[at] <- out$truncated | !out$terminated
  batch$ended[at] <- TRUE
  batch$report(sum(batch$ended))
  if (!is.null(batch$target)) {
    drop_needless_candidates(batch, unique(batch$candidate[at]))
  }
}

# A candidate whose mean return reaches the target makes all later ones needless, which are not
# played on. Candidates before it are, because one of them may reach the target, too.
drop_needless_candidates <- function(batch, candidates) {
  for (candidate in candidates) {
    own <- batch$candidate == candidate
    if (sum(own) == batch$each && all(batch$ended[own]) &&
          isTRUE(mean(batch$return[own]) >= batch$target)) {
      batch$needed <- batch$needed & batch$candidate <= candidate
    }
  }
}
