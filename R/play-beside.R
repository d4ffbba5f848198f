# Playing beside the environment: the policy is data, and the server's worker processes play whole
# episodes with it. An episode depends only on the environment, the policy, the seed and `max_steps`
# (in a group, also on its row). So it does not matter how the episodes are divided into requests.
#
# R divides the episodes into pieces. Each piece is a request, or a task for a worker of the plan.
# Answers may come in any order; R adds them in the order of the episodes.

#' Choose the vector environment that a policy plays in
#'
#' @param vector_env As passed on by [with_vector_env()].
#' @param policy The policy, bound to the environment, or several candidates.
#' @param max_steps,keep_steps As for [play_batch()].
#' @return The vector environment that plays: one that the server only described, one that R steps,
#'   or one that is `apart`, for which the policy's own program makes the environment.
#' @noRd
env_for_policy <- function(vector_env, policy, max_steps = Inf, keep_steps = FALSE) {
  vector_env$apart <- plays_apart(policy)
  if (vector_env$apart) {
    return(seen_by(policy, vector_env))
  }
  if (plays_beside(vector_env, policy, max_steps, keep_steps)) vector_env else stepped(vector_env)
}

# The environment that R steps, made on first use.
stepped <- function(vector_env) {
  if (is.null(vector_env$description)) vector_env else vector_env$make_stepped()
}

# The server refuses to play episodes that may never end.
plays_beside <- function(vector_env, policy, max_steps, keep_steps) {
  if (is.null(vector_env$description)) {
    return(FALSE)
  }
  spaces <- vector_env[c("observation_space", "action_space")]
  (is.finite(max_steps) || !vector_env$description$needs_max_steps) &&
    (!keep_steps || all(vapply(spaces, has_tensors, NA))) &&
    !is.null(policy_data(policy, vector_env))
}

#' Play all episodes of a history beside the environment
#' @inheritParams play_batches
#' @inheritParams play_batch
#' @noRd
play_beside <- function(vector_env, history, policy_of, report, target = NULL, max_steps = Inf,
                        keep_steps = FALSE, keep_next = FALSE, keep_moments = FALSE) {
  numbers <- sum(lengths(policy_data(policy_of(1L), vector_env)$tensors))
  most <- max(1L, as.integer(most_numbers %/% max(numbers, 1)))
  keep <- c("moments", "steps", "next_observation")[c(keep_moments, keep_steps, keep_next)]
  play <- new_play(
    vector_env, list_episodes(vector_env, history, most), policy_of, max_steps, keep,
    most = most, each = history$episodes, target = target, report = report,
    enter = function(batch) suspendInterrupts(enter_batch(history, batch))
  )
  if (plays_on_workers(vector_env, policy_of, NULL)) play_tasks(play) else play_requests(play)
}

# The most numbers of policies in a request.
most_numbers <- 1e6

#' List all episodes, candidate by candidate, with their seeds
#'
#' A group has consecutive episodes; it does not cross the end of a full request. If all candidates
#' play the same episodes, each candidate starts a new group.
#' @param most The number of candidates that fit into a request.
#' @return A list of vectors with an element for each episode: `candidate`, `episode`, `seed`,
#'   `sub_env` and, if episodes are played in groups, `row` (from 0).
#' @noRd
list_episodes <- function(vector_env, history, most) {
  each <- history$episodes
  count <- history$candidates
  candidate <- rep(seq_len(count), each = each)
  common <- history$common_seeds && count > 1
  group <- vector_env$description$group
  at <- seq_along(candidate) - 1L
  columns <- list(candidate = candidate, episode = rep(seq_len(each), count))
  draw <- function(n) with_generator(history$streams$seeds, history$draw_seeds(n))
  if (is.null(group)) {
    columns$seed <- if (common) rep(draw(each), count) else draw(each * count)
    columns$sub_env <- at %% vector_env$num_envs + 1L
    return(columns)
  }
  # The product may be too large for R's integers.
  within <- if (common) at %% each else at %% (as.numeric(most) * each)
  columns$row <- as.integer(within %% group)
  number <- if (common) within %/% group + 1L else cumsum(columns$row == 0L)
  columns$seed <- draw(max(number))[number]
  columns$sub_env <- columns$row + 1L
  columns
}

# The state of playing. A unit is a group or an episode, and is never divided. `begins`: the first
# episode of each unit, and the number after the last episode. `next_unit` and `size`: the first
# unit of the next piece, and its number of units. `again`: the ends of pieces that the server left
# out. `pieces`: results that wait for their turn, by the number of their first episode. `returns`:
# the returns of all episodes. `played` and `entered`: how many episodes were played, and how many
# were added to the result. `needed`: how many are needed, given the target. `failed`: the first
# episode that failed, and its error.
new_play <- function(vector_env, episodes, policy_of, max_steps, keep, enter, most = 1L, each = 1L,
                     target = NULL, report = function(ended) NULL) {
  n <- length(episodes$seed)
  rlang::env(
    vector_env = vector_env, episodes = episodes, policy_of = policy_of, max_steps = max_steps,
    keep = keep, enter = enter, most = most, each = each, target = target, report = report,
    begins = c(if (is.null(episodes$row)) seq_len(n) else which(episodes$row == 0L), n + 1L),
    next_unit = 1L, size = 1L, again = list(), pieces = new.env(parent = emptyenv()),
    returns = rep(NA_real_, n), played = 0L, entered = 0L, needed = n, failed = NULL
  )
}

#' Take the next piece to play
#' @param size The largest number of units.
#' @return A list: the numbers of its `first` and `last` episode, and of its `units`. `NULL` if
#'   there is none.
#' @noRd
take_piece <- function(play, size = play$size) {
  if (length(play$again)) {
    piece <- play$again[[1L]]
    play$again <- play$again[-1L]
    return(piece)
  }
  begins <- play$begins
  unit <- play$next_unit
  # The number after the last episode is larger than `needed`, so playing stops there, too.
  if (begins[[unit]] > play$needed || !is.null(play$failed)) {
    return(NULL)
  }
  end <- min(unit + size, length(begins))
  candidate <- play$episodes$candidate
  fits <- candidate[begins[(unit + 1L):end] - 1L] < candidate[[begins[[unit]]]] + play$most
  end <- unit + max(1L, sum(fits))
  play$next_unit <- end
  list(first = begins[[unit]], last = begins[[end]] - 1L, units = end - unit)
}

#' Record the results of a piece
#' @param batch As returned by [play_batch()], for the first episodes of the piece or for all.
#' @param error The error of the next episode after `batch`: `NULL`, or a list like a response, with
#'   `status_code`, `url` and `answer`.
#' @return Whether everything that is needed has been played.
#' @noRd
take_played <- function(play, piece, batch, error = NULL) {
  n <- length(batch$return)
  if (n) {
    play$pieces[[as.character(piece$first)]] <- batch
    play$played <- play$played + n
    play$returns[piece$first - 1L + seq_len(n)] <- batch$return
    if (!is.null(play$target)) play$needed <- needed_episodes(play$returns, play$each, play$target)
  }
  rest <- piece$first + n
  if (!is.null(error)) {
    if (rest < (play$failed$at %||% Inf)) play$failed <- list(at = rest, error = error)
  } else if (rest <= piece$last) {
    rest <- list(first = rest, last = piece$last, units = piece$units)
    play$again <- c(play$again, list(rest))
  }
  enter_in_order(play)
}

enter_in_order <- function(play) {
  repeat {
    place <- as.character(play$entered + 1L)
    batch <- play$pieces[[place]]
    if (is.null(batch) || play$entered >= play$needed) break
    wanted <- play$needed - play$entered
    if (length(batch$return) > wanted) {
      # Only searches with a target leave candidates out, and they keep no steps.
      batch <- lapply(batch[names(batch) != "steps"], utils::head, wanted)
    }
    play$enter(batch)
    play$entered <- play$entered + length(batch$return)
    rm(list = place, envir = play$pieces)
  }
  failed <- play$failed
  if (!is.null(failed) && failed$at == play$entered + 1L && play$entered < play$needed) {
    abort_http(failed$error, "POST", play$vector_env$call)
  }
  if (play$played > play$entered) play$report(min(play$played, play$needed) - play$entered)
  play$entered >= play$needed
}

# Tasks for workers --------------------------------------------------------------------------

# A task is a list of episodes. The worker requests them from its own server.
play_tasks <- function(play) {
  most <- ceiling((length(play$begins) - 1L) / (2 * future::nbrOfWorkers()))
  play$size <- min(most, 16L)
  next_task <- function() {
    piece <- take_piece(play)
    if (is.null(piece)) {
      return(NULL)
    }
    task <- episodes_task(play, piece)
    begun <- now()
    list(
      task = task, here = function() play_listed_episodes(play$vector_env, task),
      done = function(played) {
        play$size <- min(most, next_size(piece$units, now() - begun, 2))
        first <- piece$first
        for (batch in played$batches) {
          last <- first + length(batch$return) - 1L
          take_played(play, list(first = first, last = last), batch)
          first <- last + 1L
        }
        if (!is.null(played$error)) {
          take_played(play, list(first = first, last = piece$last), NULL, played$error)
        }
      }
    )
  }
  do_tasks(next_task, batch_deadline, play$vector_env$call)
}

# The policy of a task contains only the candidates of its episodes.
episodes_task <- function(play, piece) {
  vector_env <- play$vector_env
  episodes <- lapply(play$episodes, `[`, piece$first:piece$last)
  new_worker_task(
    "episodes", vector_env$recipe, server_versions(vector_env$client), episodes = episodes,
    policy = play$policy_of(unique(episodes$candidate)), most = play$most,
    max_steps = play$max_steps, keep = play$keep, num_envs = vector_env$num_envs
  )
}

#' Play a list of episodes
#' @return A list: `batches`, the results, and `error`, the error of the next episode, see
#'   [take_played()].
#' @noRd
play_listed_episodes <- function(vector_env, task) {
  batches <- list()
  candidates <- unique(task$episodes$candidate)
  policy_of <- function(these) policy_subset(task$policy, match(these, candidates))
  play <- new_play(
    vector_env, task$episodes, policy_of, task$max_steps, task$keep, most = task$most,
    enter = function(batch) batches[[length(batches) + 1L]] <<- batch
  )
  vector_env$call <- quote(rollout())
  error <- tryCatch(
    {
      play_requests(play)
      NULL
    },
    gym_error_http = function(cnd) play$failed$error %||% rlang::cnd_signal(cnd)
  )
  list(batches = batches, error = error)
}

#' @exportS3Method
run_task.gym_task_episodes <- function(task) {
  recipe <- task$recipe
  client <- gym_client()
  check_worker_gymnasium(task, client)
  described <- describe_env(recipe$env, recipe$arguments, client, task$num_envs)
  if (is.null(described)) {
    gym_abort(
      paste0("The server of worker ", Sys.getpid(), " on ", Sys.info()[["nodename"]],
             " cannot play whole episodes."),
      class = "gym_error_worker", host = Sys.info()[["nodename"]]
    )
  }
  play_listed_episodes(described, task)
}
