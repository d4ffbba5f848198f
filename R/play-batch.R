# A batch of episodes is played by a function that changes nothing: what comes of it depends on the
# environment, the policy, the seeds and the random stream alone. So a batch that was lost can be
# played again, and it does not matter in which order batches are played, and by whom.
#
# Sub-environment i of n plays the episodes i, i + n, i + 2n and so on of its batch. Which of them
# plays an episode is written down before the first step. If the next one were given to whichever
# ends first, and playing stopped at the number of episodes asked for, short episodes would be
# favoured.

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
  at_once <- vector_env$num_envs
  batch <- rlang::env(
    candidate = episodes$candidate, episode = episodes$episode, seed = episodes$seed,
    sub_env = (seq_len(n) - 1L) %% at_once + 1L, return = numeric(n), length = integer(n),
    terminated = logical(n), truncated = logical(n), ended = logical(n), needed = n,
    steps = list(), frames = list(), target = target, each = each, report = report
  )
  # Where all sub-environments must be reset together, they wait for each other after each episode.
  together <- if (vector_env$one_seed) at_once else n
  play <- function() {
    for (first in seq(1L, n, by = together)) {
      if (first <= batch$needed) {
        last <- min(n, first + together - 1L)
        play_episodes(vector_env, batch, first, last, policy, max_steps, keep_steps, keep_next)
      }
    }
  }
  with_generator(new_generator(stream = stream), naming_call(play(), vector_env))
  columns <- c("candidate", "episode", "seed", "sub_env", "return", "length", "terminated",
               "truncated")
  c(lapply(mget(columns, batch), utils::head, batch$needed), mget(c("steps", "frames"), batch))
}

# An error of the environment names the user's call, not the step that was taken for it.
naming_call <- function(code, vector_env) {
  withCallingHandlers(
    code,
    gym_error = function(cnd) {
      if (is.null(cnd$call) || identical(cnd$call[[1L]], quote(step))) {
        cnd["call"] <- list(rlang::error_call(vector_env$call))
        rlang::cnd_signal(cnd)
      }
    }
  )
}

# Plays the episodes from `first` to `last` of a batch. `game` is what stays the same, `player` what
# changes: `rows` has an element for each sub-environment that plays (which episode of the batch,
# its number, the return so far, and how many steps had been taken when the episode began), and
# `observation` a row.
play_episodes <- function(vector_env, batch, first, last, policy, max_steps, keep_steps,
                          keep_next) {
  game <- list(
    vector_env = vector_env, batch = batch, last = last, policy = policy, max_steps = max_steps,
    keep_steps = keep_steps, keep_next = keep_next
  )
  episode <- seq.int(first, min(last, batch$needed, first + vector_env$num_envs - 1L))
  observation <- begin_episodes(vector_env, batch, episode, last)
  ask_beforehand(policy, batch, episode, observation, vector_env)
  rows <- list(episode = episode, sub_env = batch$sub_env[episode],
               return = numeric(length(episode)), began = integer(length(episode)))
  player <- new_player(game, rows, observation)
  step <- if (keep_next) vector_env$step else vector_env$step_bare %||% vector_env$step
  while (length(player$rows$episode)) {
    n <- length(player$rows$episode)
    player$action <- act_batch(player$acting, player$observation, n, vector_env)
    out <- step(player$action, player$rows$sub_env)
    end_step(game, player, out)
  }
}

new_player <- function(game, rows, observation) {
  candidate <- game$batch$candidate[rows$episode]
  rlang::env(
    rows = rows, observation = observation, taken = 0L, action = NULL,
    candidate = candidate, acting = policy_rows(game$policy, candidate)
  )
}

#' Note what came of a step, and begin the next episodes where some have ended
#' @param out As a step of [as_vector_env()] returns it.
#' @noRd
end_step <- function(game, player, out) {
  batch <- game$batch
  rows <- player$rows
  player$taken <- player$taken + 1L
  keep_frame(batch, game$vector_env, rows$episode)
  player$rows$return <- rows$return + out$reward
  if (game$keep_steps) {
    batch$steps[[length(batch$steps) + 1L]] <- list(
      at = rows$episode, observation = player$observation, action = player$action,
      reward = out$reward, terminated = out$terminated, truncated = out$truncated,
      next_observation = if (game$keep_next) out$next_observation
    )
  }
  player$observation <- out$observation
  ended <- out$terminated | out$truncated
  # Where an episode is cut short the environment begins no other by itself.
  waiting <- if (isTRUE(game$vector_env$begins_next)) !ended else TRUE
  if (game$max_steps < Inf) {
    ended <- ended | player$taken - rows$began >= game$max_steps
  }
  if (any(ended)) {
    length <- (player$taken - rows$began)[ended]
    end_episodes(batch, rows$episode[ended], player$rows$return[ended], length,
                 lapply(out[flags], `[`, ended))
    begin_next_episodes(game, player, ended, ended & waiting)
  }
}

# `waiting` are those that have `ended` and that the environment does not begin by itself.
begin_next_episodes <- function(game, player, ended, waiting) {
  vector_env <- game$vector_env
  batch <- game$batch
  rows <- player$rows
  rows$episode[ended] <- rows$episode[ended] + vector_env$num_envs
  rows$return[ended] <- 0
  rows$began[ended] <- player$taken
  going <- which(rows$episode <= min(game$last, batch$needed))
  if (length(going) < length(ended)) {
    rows <- lapply(rows, `[`, going)
    waiting <- waiting[going]
    player$observation <- batch_rows(vector_env$observation_space, player$observation, going)
  }
  player$rows <- rows
  if (!length(going)) {
    return(invisible())
  }
  if (any(waiting)) {
    player$observation <- begin_waiting(game, rows, player$observation, which(waiting))
  }
  begun <- which(rows$began == player$taken)
  ask_beforehand(game$policy, batch, rows$episode, player$observation, vector_env, begun)
  candidate <- batch$candidate[rows$episode]
  if (!identical(candidate, player$candidate)) {
    player$candidate <- candidate
    player$acting <- policy_rows(game$policy, candidate)
  }
}

# Puts the first observations of the episodes that the environment does not begin by itself in the
# place of the last observations of those before.
begin_waiting <- function(game, rows, observation, waiting) {
  begun <- begin_episodes(game$vector_env, game$batch, rows$episode[waiting], game$last)
  n <- length(rows$episode)
  if (length(waiting) == n) {
    begun
  } else {
    replace_rows(game$vector_env$observation_space, observation, n, waiting, begun)
  }
}

# Resets the sub-environments of the episodes that begin. Where all must be reset together, those
# that play none are left out of what it returns. One that begins its next episodes by itself gets
# the seeds of all of them, up to the episode `last`.
begin_episodes <- function(vector_env, batch, episode, last) {
  sub_envs <- batch$sub_env[episode]
  observation <- if (vector_env$one_seed) {
    of_all <- vector_env$reset(batch$seed[[episode[[1L]]]])
    batch_rows(vector_env$observation_space, of_all, sub_envs)
  } else if (isTRUE(vector_env$begins_next)) {
    last <- min(last, batch$needed)
    seeds <- lapply(episode, function(first) {
      batch$seed[seq.int(first, last, by = vector_env$num_envs)]
    })
    vector_env$reset(seeds, sub_envs)
  } else {
    vector_env$reset(batch$seed[episode], sub_envs)
  }
  keep_frame(batch, vector_env, episode)
  observation
}

# A function is asked about a single episode before it plays several of them side by side.
ask_beforehand <- function(policy, batch, episode, observation, vector_env,
                           begun = seq_along(episode)) {
  if (vector_env$num_envs == 1L || !(is.function(policy) || inherits(policy, "gym_policy_list"))) {
    return(invisible())
  }
  for (row in begun[batch$episode[episode[begun]] == 1L]) {
    candidate <- batch$candidate[[episode[[row]]]]
    asked <- policy_subset(policy, candidate)
    if (is.function(asked) && sum(batch$candidate == candidate) > 1L) {
      one <- batch_rows(vector_env$observation_space, observation, row)
      ask_about_one(asked, one, vector_env)
    }
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
# played on: of the batch's episodes the first `needed` are. Candidates before it are played on,
# because one of them may reach the target, too.
drop_needless_candidates <- function(batch, candidates) {
  for (candidate in candidates) {
    own <- batch$candidate == candidate
    if (sum(own) == batch$each && all(batch$ended[own]) &&
          isTRUE(mean(batch$return[own]) >= batch$target)) {
      batch$needed <- min(batch$needed, sum(batch$candidate <= candidate))
    }
  }
}
