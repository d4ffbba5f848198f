# Episodes of many candidates: those that the server plays by itself are all asked for together
# (play-beside.R), others are cut into batches and played from R, batch after batch.
#
# The rule: episodes are taken candidate after candidate. A batch has as many whole candidates as
# there is room for, and at least one; a candidate with more episodes than that is cut into batches
# of its own. How much room there is (`batch_size`) depends on the environment: as many episodes as
# there are sub-environments where these wait for each other, four times as many where each plays on
# by itself. An environment that remembers something over episodes plays all of them in one batch.
#
# So how many cores there are, who plays a batch and how long it takes never decide what is played.

#' Cut episodes into batches
#'
#' @param batch_size How many episodes make a batch, `Inf` for all.
#' @param candidates,episodes How many candidates there are, and how many episodes each plays.
#' @return A function of the number of a batch, which returns a list with an element for each of its
#'   episodes in `candidate` and `episode` (integers), and `NULL` after the last batch.
#' @noRd
cut_batches <- function(batch_size, candidates, episodes) {
  if (episodes <= batch_size) {
    per_batch <- min(candidates, batch_size %/% episodes)
    function(batch) {
      first <- (batch - 1) * per_batch + 1
      if (first <= candidates) {
        numbers <- as.integer(seq(first, min(candidates, first + per_batch - 1)))
        list(
          candidate = rep(numbers, each = episodes),
          episode = rep(seq_len(episodes), length(numbers))
        )
      }
    }
  } else {
    pieces <- ceiling(episodes / batch_size)
    function(batch) {
      candidate <- as.integer((batch - 1) %/% pieces + 1)
      first <- ((batch - 1) %% pieces) * batch_size + 1
      if (candidate <= candidates) {
        numbers <- as.integer(seq(first, min(episodes, first + batch_size - 1)))
        list(candidate = rep(candidate, length(numbers)), episode = numbers)
      }
    }
  }
}

#' Make an empty history of batches
#'
#' @param candidates,episodes How many candidates there are, and how many episodes each plays.
#' @param streams As [new_streams()] makes them.
#' @param common_seeds Whether all candidates begin their episodes with the same seeds, where each
#'   episode has a seed of its own.
#' @return An environment: these, how many batches were drawn and episodes played, and `batches`,
#'   what [play_batch()] returned for each.
#' @noRd
new_history <- function(candidates, episodes, streams, common_seeds = FALSE) {
  rlang::env(
    candidates = candidates, episodes = as.integer(episodes), streams = streams,
    common_seeds = common_seeds, draw_seeds = draw_environment_seeds, seeds = NULL,
    drawn_batches = 0, played_episodes = 0, batches = list()
  )
}

#' Play batches until all episodes have been played
#'
#' @param history As [new_history()] returns it. It has the batches that were played also when an
#'   error or an interrupt ends the playing.
#' @param policy_of A function of the numbers of the candidates of a batch, which returns the policy
#'   that plays it; `candidate` then counts from 1 in this policy.
#' @param report A function that is called with how many episodes have ended in the present batch.
#' @param ... Further arguments of [play_batch()].
#' @param learner As for [play_batch()].
#' @noRd
play_batches <- function(vector_env, history, policy_of, report = function(ended) NULL, ...,
                         learner = NULL, max_steps = Inf) {
  check_has_end(vector_env, max_steps)
  vector_env <- if (is.null(learner)) {
    keep_steps <- isTRUE(list(...)$keep_steps)
    env_for_policy(vector_env, policy_of(seq_len(history$candidates)), max_steps, keep_steps)
  } else {
    stepped(vector_env)
  }
  if (!is.null(vector_env$description)) {
    return(play_beside(vector_env, history, policy_of, report, ..., max_steps = max_steps))
  }
  if (plays_on_workers(vector_env, policy_of, learner)) {
    return(play_in_futures(
      vector_env, history, policy_of, report, ..., max_steps = max_steps
    ))
  }
  while (!is.null(batch <- next_batch(vector_env, history))) {
    played <- play_drawn_batch(
      vector_env, batch, policy_of, report, ..., learner = learner, max_steps = max_steps
    )
    # An interrupt finds the batch entered completely, or not at all.
    suspendInterrupts(enter_batch(history, played))
  }
}

# Where it is known that no episode ever ends, nothing would come of playing.
check_has_end <- function(vector_env, max_steps) {
  if (isTRUE(vector_env$endless) && is.infinite(max_steps)) {
    gym_abort(
      c(paste0("Episodes of ", environment_label(vector_env), " have no end, whatever is done."),
        i = "Give `max_steps`, after which an episode is cut off."),
      class = "gym_error_argument", argument = "max_steps", call = vector_env$call
    )
  }
}

#' Draw what the next batch is played with
#'
#' What comes of a batch depends on this alone, so that batches can be played in any order, as long
#' as they are drawn and entered in theirs.
#' @return A list: `episodes`, as [play_batch()] takes them, with the candidates' own numbers,
#'   `each`, how many a candidate plays, and `stream`; `NULL` when there is no further batch.
#' @noRd
next_batch <- function(vector_env, history) {
  batch_size <- if (length(vector_env$remembers)) Inf else vector_env$batch_size
  cut <- cut_batches(batch_size, history$candidates, history$episodes)
  episodes <- cut(history$drawn_batches + 1)
  if (is.null(episodes)) {
    return(NULL)
  }
  history$drawn_batches <- history$drawn_batches + 1
  episodes$seed <- draw_episode_seeds(vector_env, history, episodes)
  list(episodes = episodes, each = history$episodes, stream = take_stream(history$streams))
}

# Plays a batch. Its policy has its candidates alone.
play_drawn_batch <- function(vector_env, batch, policy_of, report = function(ended) NULL, ...) {
  episodes <- batch$episodes
  candidates <- unique(episodes$candidate)
  episodes$candidate <- match(episodes$candidate, candidates)
  played <- play_batch(
    vector_env, policy_of(candidates), episodes, batch$stream, each = batch$each, report = report,
    ...
  )
  played$candidate <- candidates[played$candidate]
  played
}

enter_batch <- function(history, played) {
  history$batches[[length(history$batches) + 1L]] <- played
  history$played_episodes <- history$played_episodes + length(played$episode)
}

# Whether candidates can play the same episodes: not where R steps sub-environments that share a
# seed.
has_common_seeds <- function(vector_env) !vector_env$one_seed || !is.null(vector_env$description)

# Where one generator serves all sub-environments, those that begin together share a seed.
draw_episode_seeds <- function(vector_env, history, episodes) {
  draw <- function(n) with_generator(history$streams$seeds, history$draw_seeds(n))
  n <- length(episodes$episode)
  if (vector_env$one_seed) {
    at_once <- vector_env$num_envs
    rep(draw(ceiling(n / at_once)), each = at_once, length.out = n)
  } else if (history$common_seeds && history$candidates > 1) {
    history$seeds <- history$seeds %||% draw(history$episodes)
    history$seeds[episodes$episode]
  } else {
    draw(n)
  }
}
