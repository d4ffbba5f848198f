# play_batch() plays a batch of episodes and keeps nothing from one batch to the next. Its result
# depends only on the environment, the policy, the seeds and the random stream. So a lost batch can
# be played again, in any order and on any worker.
#
# Sub-environment i of n plays the episodes i, i + n, i + 2n and so on of its batch. This is fixed
# before the first step. Otherwise, if the sub-environment that ends first got the next episode, and
# playing stopped after a number of episodes, the result would have too many short episodes.

#' Play a batch of episodes
#'
#' Random numbers come from the batch's own stream; the session's generator does not change. An
#' error or an interrupt ends the batch without a result.
#' @param vector_env As returned by [as_vector_env()].
#' @param policy The policy, bound to the environment, or the candidates that play the batch.
#' @param episodes A list of vectors with an element for each episode: `candidate` (the number of
#'   the candidate that plays it), `episode` (its number among the candidate's episodes) and `seed`.
#' @param stream The stream that the policy draws from.
#' @param max_steps The number of steps after which an episode is cut off.
#' @param target The mean return of a candidate after which later candidates need not be played,
#'   `NULL` for none.
#' @param each The number of episodes of a candidate.
#' @param keep_moments Whether to keep the moments of the observations before each action.
#' @param keep_steps,keep_next Whether to keep each step, and the observation after it.
#' @param learner `NULL`, or a list of two functions that replace the policy: `act`, a function of
#'   the observations and the numbers of their sub-environments, and `observe`, a function of the
#'   results of each step, see [agent_observe()].
#' @param report A function that is called with the number of finished episodes.
#' @return A list of vectors with an element for each episode: those of `episodes`, `sub_env`,
#'   `return`, `length`, `terminated`, `truncated`; and the lists `steps`, `frames` and `moments`
#'   (one element, for all episodes together). Candidates after the first one that reached the
#'   target are left out.
#' @noRd
play_batch <- function(vector_env, policy, episodes, stream, max_steps = Inf, target = NULL,
                       each = 1L, keep_steps = FALSE, keep_next = FALSE, keep_moments = FALSE,
                       learner = NULL, report = function(ended) NULL) {
  # Let R itself multiply matrices. Then a row of the product does not depend on the other rows, to
  # the last bit. Some libraries of linear algebra do not guarantee this.
  matprod <- options(matprod = "internal")
  on.exit(options(matprod))
  n <- length(episodes$episode)
  at_once <- if (vector_env$one_seed) vector_env$num_envs else min(n, vector_env$num_envs)
  candidates <- unique(episodes$candidate)
  batch <- rlang::env(
    candidate = match(episodes$candidate, candidates), episode = episodes$episode,
    seed = episodes$seed, sub_env = (seq_len(n) - 1L) %% at_once + 1L,
    return = numeric(n), length = integer(n),
    terminated = logical(n), truncated = logical(n), ended = logical(n), needed = n,
    # Moments count the observations of all episodes: with a target, they would depend on which
    # episodes end first.
    target = if (!keep_moments) target, each = each,
    steps = list(), frames = list(), report = report,
    vector_env = vector_env, policy = with_memory(policy, at_once), max_steps = max_steps,
    keep_steps = keep_steps, keep_next = keep_next, learner = learner, at_once = at_once,
    clips = clips_actions(policy), moments = if (keep_moments) no_moments(), noted = list()
  )
  # If all sub-environments must be reset together, they wait for each other after each episode.
  together <- if (vector_env$one_seed) at_once else n
  play <- function() {
    for (first in seq(1L, n, by = together)) {
      if (first <= batch$needed) play_episodes(batch, first, min(n, first + together - 1L))
    }
  }
  with_generator(new_generator(stream = stream), naming_call(play(), vector_env))
  columns <- c("candidate", "episode", "seed", "sub_env", "return", "length", "terminated",
               "truncated")
  kept <- mget(c("steps", "frames"), batch)
  kept["moments"] <- list(if (keep_moments) list(batch$moments))
  needed <- if (is.null(target)) n else needed_episodes(batch$return, each, target)
  episodes <- lapply(mget(columns, batch), utils::head, needed)
  episodes$candidate <- candidates[episodes$candidate]
  c(episodes, kept)
}

# Makes errors name the user's call, because the user did not take the step that failed.
naming_call <- function(code, vector_env) {
  withCallingHandlers(
    code,
    error = function(cnd) {
      if (!inherits(cnd, "gym_error") && is_about_one(cnd)) abort_about_one(cnd, vector_env)
    },
    gym_error = function(cnd) {
      # Did a reset or a step of this package raise it, and not one that a user wrote?
      steps <- list(quote(step), quote(env$step), quote(env$reset))
      own <- is.null(cnd$call) || any(vapply(steps, identical, NA, cnd$call[[1L]]))
      if (!own) return()
      cnd["call"] <- list(rlang::error_call(vector_env$call))
      # Errors about an observation name the argument that is to blame.
      if (inherits(cnd, "gym_error_space") && is.null(cnd$argument)) {
        hint <- rlang::format_error_bullets(c(i = "The policy returned this action."))
        cnd$message <- paste0(cnd$message, "\n", hint)
      }
      rlang::cnd_signal(cnd)
    }
  )
}

# Plays the episodes from `first` to `last` of a batch. `playing` is the state that changes with
# each step. Its vectors in `rows` have an element for each running sub-environment: its episode in
# the batch, its number, the return so far, and the number of steps before the episode began.
# `observation` has a row for each of them, `candidate` the candidate, and `acting` is the policy
# for these rows.
play_episodes <- function(batch, first, last) {
  vector_env <- batch$vector_env
  episode <- seq.int(first, min(last, batch$needed, first + batch$at_once - 1L))
  observation <- begin_episodes(batch, episode, last)
  ask_beforehand(batch, episode, observation)
  candidate <- batch$candidate[episode]
  playing <- rlang::env(
    last = last, taken = 0L, observation = observation,
    rows = list(episode = episode, sub_env = batch$sub_env[episode],
                return = numeric(length(episode)), began = integer(length(episode))),
    candidate = candidate, acting = policy_rows(batch$policy, candidate, batch$sub_env[episode])
  )
  begin_memory(batch$policy, playing$rows$sub_env)
  whole <- batch$keep_next || !is.null(batch$learner)
  step <- if (whole) vector_env$step else vector_env$step_bare %||% vector_env$step
  while (length(playing$rows$episode)) {
    action <- if (is.null(batch$learner)) {
      act_batch(playing$acting, playing$observation, length(playing$rows$sub_env), vector_env)
    } else {
      batch$learner$act(playing$observation, playing$rows$sub_env)
    }
    stepped <- if (batch$clips) clip_actions(vector_env$action_space, action) else action
    out <- step(stepped, playing$rows$sub_env)
    if (!is.null(batch$learner)) {
      rows <- playing$rows
      # An episode that `max_steps` cuts off is truncated.
      cut <- playing$taken + 1L - rows$began >= batch$max_steps
      batch$learner$observe(list(
        observation = playing$observation, action = action, reward = out$reward,
        next_observation = out$next_observation, terminated = out$terminated,
        truncated = (out$truncated | cut) & !out$terminated,
        first = rows$began == playing$taken, sub_env = rows$sub_env
      ))
    }
    end_step(batch, playing, action, out)
  }
  add_noted(batch)
}

#' Record the results of a step, and start the next episodes
#' @param out As returned by a step of [as_vector_env()].
#' @noRd
end_step <- function(batch, playing, action, out) {
  rows <- playing$rows
  playing$taken <- playing$taken + 1L
  keep_frame(batch, rows$episode)
  playing$rows$return <- rows$return + out$reward
  if (!is.null(batch$moments)) {
    values <- number_rows(playing$observation)
    batch$noted[[length(batch$noted) + 1L]] <- values
    # Adding a few rows to the moments takes R as long as adding hundreds. So this adds several
    # steps together. Their number depends only on the size of an observation.
    together <- max(1L, min(64L, 8192L %/% ncol(values)))
    if (playing$taken %% together == 0L) add_noted(batch)
  }
  if (batch$keep_steps) {
    batch$steps[[length(batch$steps) + 1L]] <- list(
      at = rows$episode, observation = playing$observation, action = action,
      reward = out$reward, terminated = out$terminated, truncated = out$truncated,
      next_observation = if (batch$keep_next) out$next_observation
    )
  }
  playing$observation <- out$observation
  ended <- out$terminated | out$truncated
  # If `max_steps` cuts an episode off, the environment does not start the next one itself.
  waiting <- if (isTRUE(batch$vector_env$begins_next)) !ended else TRUE
  if (batch$max_steps < Inf) ended <- ended | playing$taken - rows$began >= batch$max_steps
  if (any(ended)) {
    length <- (playing$taken - rows$began)[ended]
    end_episodes(batch, rows$episode[ended], playing$rows$return[ended], length,
                 lapply(out[flags], `[`, ended))
    begin_next_episodes(batch, playing, ended, ended & waiting)
  }
}

# `waiting` are those of `ended` that the environment does not restart itself.
begin_next_episodes <- function(batch, playing, ended, waiting) {
  vector_env <- batch$vector_env
  rows <- playing$rows
  rows$episode[ended] <- rows$episode[ended] + batch$at_once
  rows$return[ended] <- 0
  rows$began[ended] <- playing$taken
  going <- which(rows$episode <= min(playing$last, batch$needed))
  if (length(going) < length(ended)) {
    rows <- lapply(rows, `[`, going)
    waiting <- waiting[going]
    playing$observation <- batch_rows(vector_env$observation_space, playing$observation, going)
  }
  playing$rows <- rows
  if (!length(going)) {
    return(invisible())
  }
  if (any(waiting)) {
    # The first observations of new episodes that the environment does not start itself.
    begun <- begin_episodes(batch, rows$episode[waiting], playing$last)
    playing$observation <- if (all(waiting)) {
      begun
    } else {
      replace_rows(vector_env$observation_space, playing$observation, length(waiting),
                   which(waiting), begun)
    }
  }
  begun <- which(rows$began == playing$taken)
  begin_memory(batch$policy, rows$sub_env[begun])
  ask_beforehand(batch, rows$episode, playing$observation, begun)
  candidate <- batch$candidate[rows$episode]
  if (!identical(candidate, playing$candidate)) {
    playing$candidate <- candidate
    playing$acting <- policy_rows(batch$policy, candidate, rows$sub_env)
  }
}

# Resets the sub-environments of new episodes. If all must be reset together, the result has only
# those that play. A sub-environment that starts its next episode itself gets the seeds of all its
# episodes, up to the episode `last`.
begin_episodes <- function(batch, episode, last) {
  vector_env <- batch$vector_env
  sub_envs <- batch$sub_env[episode]
  observation <- if (vector_env$one_seed) {
    of_all <- vector_env$reset(batch$seed[[episode[[1L]]]])
    batch_rows(vector_env$observation_space, of_all, sub_envs)
  } else if (isTRUE(vector_env$begins_next)) {
    last <- min(last, batch$needed)
    seeds <- lapply(episode, function(first) {
      batch$seed[seq.int(first, last, by = batch$at_once)]
    })
    vector_env$reset(seeds, sub_envs)
  } else {
    vector_env$reset(batch$seed[episode], sub_envs)
  }
  keep_frame(batch, episode)
  observation
}

# Before a user's function plays several episodes together, calls it with a single observation.
ask_beforehand <- function(batch, episode, observation, begun = seq_along(episode)) {
  policy <- batch$policy
  vector_env <- batch$vector_env
  asks <- calls_function(policy) || inherits(policy, "gym_policy_list")
  if (vector_env$num_envs == 1L || !asks) {
    return(invisible())
  }
  for (row in begun[batch$episode[episode[begun]] == 1L]) {
    candidate <- batch$candidate[[episode[[row]]]]
    asked <- policy_subset(policy, candidate)
    if (calls_function(asked) && sum(batch$candidate == candidate) > 1L) {
      one <- batch_rows(vector_env$observation_space, observation, row)
      ask_about_one(asked, one, vector_env)
    }
  }
}

calls_function <- function(policy) is.function(policy) || inherits(policy, "gym_policy_memory")

# Frames are kept with one sub-environment, which plays one episode after the other.
keep_frame <- function(batch, episode) {
  frame <- batch$vector_env$frame
  if (!is.null(frame)) {
    frames <- if (length(batch$frames) >= episode) batch$frames[[episode]]
    batch$frames[[episode]] <- c(frames, list(frame()))
  }
}

# If the environment neither terminated nor truncated an episode, `max_steps` cut it off: it counts
# as truncated.
end_episodes <- function(batch, at, returns, length, out) {
  batch$return[at] <- returns
  batch$length[at] <- length
  batch$terminated[at] <- out$terminated
  batch$truncated[at] <- out$truncated | !out$terminated
  batch$ended[at] <- TRUE
  batch$report(sum(batch$ended))
  if (!is.null(batch$target)) {
    batch$needed <- needed_episodes(ifelse(batch$ended, batch$return, NA), batch$each, batch$target)
  }
}

# The number of episodes that are needed: all up to the first candidate whose mean return reaches
# the target. Earlier candidates must finish, because they may reach the target, too.
needed_episodes <- function(returns, each, target) {
  n <- length(returns)
  reached <- if (n >= each) which(colMeans(matrix(returns, each)) >= target)
  min(reached[1L] * each, n, na.rm = TRUE)
}

# Moments of observations ------------------------------------------------------------------

add_noted <- function(batch) {
  if (length(batch$noted)) {
    batch$moments <- merge_moments(batch$moments, moments_of(do.call(rbind, batch$noted)))
    batch$noted <- list()
  }
}
