# Episodes of many candidates. If the server plays whole episodes, R requests them in large pieces
# (play-beside.R). Otherwise R plays them itself, batch after batch.
#
# If R plays, batches take the episodes candidate by candidate. A batch has as many whole candidates
# as fit; a candidate with more episodes than a batch has batches of its own. The size of a batch
# (`batch_size`) depends on the environment: as many episodes as sub-environments if these wait for
# each other, four times as many if each plays on independently. If a wrapper remembers earlier
# episodes, all episodes are in one batch.
#
# So the number of cores, the worker and the time never change the result.

#' Make a history: what is to be played, and the results of what has been played
#'
#' @param candidates,episodes The number of candidates, and the number of episodes of each.
#' @param streams As made by [new_streams()].
#' @param common_seeds Whether all candidates use the same seeds for their episodes, if each episode
#'   has its own seed.
#' @return An environment with the arguments, `played_episodes` (the number of episodes played),
#'   `batches` (the results of [play_batch()]), and `draw_seeds`, a function that draws so many
#'   seeds of episodes.
#' @noRd
new_history <- function(candidates, episodes, streams, common_seeds = FALSE) {
  rlang::env(
    candidates = candidates, episodes = as.integer(episodes), streams = streams,
    common_seeds = common_seeds, draw_seeds = draw_environment_seeds, played_episodes = 0,
    batches = list()
  )
}

#' Play batches until all episodes have been played
#'
#' @param vector_env As returned by [env_for_policy()], or by [stepped()] with a learner.
#' @param history As returned by [new_history()]. After an error or an interrupt it has the batches
#'   that were played.
#' @param policy_of A function of the numbers of the candidates in a batch. It returns the policy
#'   that plays the batch, with only these candidates.
#' @param report A function that is called with the number of finished episodes in the current
#'   batch.
#' @param ... Further arguments of [play_batch()].
#' @param learner As for [play_batch()].
#' @noRd
play_batches <- function(vector_env, history, policy_of, report = function(ended) NULL, ...,
                         keep_steps = FALSE, learner = NULL, max_steps = Inf) {
  check_has_end(vector_env, max_steps)
  if (isTRUE(vector_env$apart)) {
    return(play_apart(vector_env, history, policy_of, report, max_steps, keep_steps, ...))
  }
  if (!is.null(vector_env$description)) {
    return(play_beside(
      vector_env, history, policy_of, report, ..., keep_steps = keep_steps, max_steps = max_steps
    ))
  }
  batches <- draw_batches(vector_env, history)
  if (plays_on_workers(vector_env, policy_of, learner)) {
    return(play_in_futures(
      vector_env, batches, history, policy_of, report, keep_steps = keep_steps,
      max_steps = max_steps, ...
    ))
  }
  for (batch in batches) {
    # The policy contains only the candidates of the batch.
    policy <- policy_of(unique(batch$episodes$candidate))
    played <- play_batch(
      vector_env, policy, batch$episodes, batch$stream, each = batch$each, report = report, ...,
      keep_steps = keep_steps, learner = learner, max_steps = max_steps
    )
    # An interrupt must not come between: a batch is added completely or not at all.
    suspendInterrupts(enter_batch(history, played))
  }
}

# If no episode ever ends, playing would never return.
check_has_end <- function(vector_env, max_steps) {
  if (isTRUE(vector_env$endless) && is.infinite(max_steps)) {
    abort_wrong("max_steps", NULL, vector_env$call,
                "Episodes of {environment_label(vector_env)} never end.",
                i = "Give `max_steps`, after which an episode is cut off.")
  }
}

#' Draw what each batch is played with
#'
#' The result of a batch depends only on this. So batches can be played in any order, if their
#' results are added in the order of the batches.
#' @return A list with a list for each batch: `episodes`, as for [play_batch()], `each`, the number
#'   of episodes of a candidate, and `stream`.
#' @noRd
draw_batches <- function(vector_env, history) {
  each <- history$episodes
  candidate <- rep(seq_len(history$candidates), each = each)
  episode <- rep(seq_len(each), history$candidates)
  draw <- function(n) with_generator(history$streams$seeds, history$draw_seeds(n))
  one_seed <- vector_env$one_seed
  common <- if (history$common_seeds && history$candidates > 1 && !one_seed) draw(each)
  size <- if (length(vector_env$remembers)) length(episode) else vector_env$batch_size
  lapply(unname(split(seq_along(episode), batch_numbers(size, candidate, episode))), function(at) {
    n <- length(at)
    seed <- if (one_seed) {
      # Sub-environments with one generator that start together share a seed.
      at_once <- vector_env$num_envs
      rep(draw(ceiling(n / at_once)), each = at_once, length.out = n)
    } else if (is.null(common)) {
      draw(n)
    } else {
      common[episode[at]]
    }
    list(
      episodes = list(candidate = candidate[at], episode = episode[at], seed = seed),
      each = each, stream = take_stream(history$streams)
    )
  })
}

# The batch of each episode, by the rule above.
batch_numbers <- function(size, candidate, episode) {
  each <- max(episode)
  if (each <= size) {
    (candidate - 1) %/% (size %/% each)
  } else {
    (candidate - 1) * ceiling(each / size) + (episode - 1) %/% size
  }
}

enter_batch <- function(history, played) {
  history$batches[[length(history$batches) + 1L]] <- played
  history$played_episodes <- history$played_episodes + length(played$episode)
}

# The returns and lengths of all episodes.
episode_results <- function(history) {
  lapply(c(returns = "return", lengths = "length"), function(name) {
    unlist(lapply(history$batches, `[[`, name))
  })
}

# The environment that plays --------------------------------------------------------------

#' Call a function with the vector environment of an environment
#'
#' If this makes the vector environment, it closes it when `play` returns.
#' @param episodes The largest number of episodes.
#' @param play A function of the vector environment.
#' @param max_steps The user's value. A smaller limit of the environment gives a warning.
#' @param ... Further arguments of [as_vector_env()].
#' @param client The user's client. Its default starts a server, so this only passes it on: a method
#'   for an environment without a server never evaluates it.
#' @param seed The seed of a random map, see [with_random_map()].
#' @noRd
with_vector_env <- function(env, episodes, play, max_steps = NULL, ..., client = gym_client(),
                            seed = NULL, call = rlang::caller_env()) {
  # Errors from making the environment should name the user's call, too.
  rlang::local_error_call(call)
  check_dots_named(list(...), "is_slippery = FALSE", call)
  arguments <- with_random_map(env, list(...), seed)
  made <- NULL
  finished <- FALSE
  on.exit(if (!is.null(made)) made$close(wait = finished))
  complete <- function(vector_env) {
    vector_env$call <- call
    vector_env$recipe <- environment_recipe(env, vector_env, arguments)
    vector_env$made_of <- list(env = env, arguments = arguments)
    vector_env
  }
  make <- function() {
    if (is.null(made)) {
      vector_env <- naming_own_call(
        rlang::inject(as_vector_env(env, !!!arguments, client = client, max_envs = episodes)),
        "as_vector_env", call
      )
      made <<- complete(vector_env)
      inform_of_play(made, env)
    }
    made
  }
  # Arguments about sub-environments are not arguments of the environment.
  of_sub_envs <- rlang::names2(arguments) %in% c("num_envs", "num_workers", "frames")
  given <- arguments[of_sub_envs]
  check_count(given$num_envs, allow_null = TRUE, arg = "num_envs", call = call)
  check_count(given$num_workers, min = 0, allow_null = TRUE, arg = "num_workers", call = call)
  vector_env <- describe_env(
    env, arguments[!of_sub_envs], client, given$num_envs, isTRUE(given$frames), call = call
  )
  if (isTRUE(vector_env$one_seed)) check_no_workers(given$num_workers, call)
  if (is.null(vector_env)) {
    vector_env <- make()
  } else {
    vector_env <- complete(vector_env)
    vector_env$make_stepped <- make
  }
  warn_of_own_limit(max_steps, vector_env, call)
  value <- play(vector_env)
  finished <- TRUE
  value
}

# `max_steps` cannot extend the environment's own limit.
warn_of_own_limit <- function(max_steps, vector_env, call) {
  own <- vector_env$spec$max_episode_steps
  if (!is.null(max_steps) && !is.null(own) && own < max_steps) {
    wanted <- format(max_steps, scientific = FALSE)
    id <- environment_label(vector_env)
    rlang::warn(
      c(paste0("`max_steps = ", wanted, "` makes no episode longer: ", id,
               " has a limit of its own, ", count_of(own, "step"), "."),
        i = paste0("`max_episode_steps = ", wanted, "` as a further argument of `gym_make()` ",
                   "sets another limit; a TimeLimit wrapper can only lower it.")),
      class = "gym_warning_max_steps", call = call
    )
  }
}

# Tells the user why R plays one episode after the other, or step by step, if a wrapper is the
# reason.
inform_of_play <- function(vector_env, env) {
  given <- given_id(env)
  if (length(vector_env$remembers) && !is.null(given)) {
    rlang::inform(
      c(i = paste0(paste(vector_env$remembers, collapse = " and "), " remembers earlier episodes, ",
                   "so they are played one after the other, in one batch.")),
      class = "gym_message_remembers"
    )
  }
  if (isTRUE(given$calls_r) && !given$registered) {
    names <- intersect(names(transforms), vector_env$spec$wrappers)
    rlang::inform(
      c(i = paste0(paste(names, collapse = " and "), " calls an R function in each step, so R ",
                   "plays step by step, which takes longer than playing on the server.")),
      class = "gym_message_calls_r", .frequency = "once", .frequency_id = "gym_calls_r"
    )
  }
}

# Progress, interrupts, and results after an early end ---------------------------------------

#' Play until the end or an interrupt
#'
#' @param play Code that plays.
#' @param text A message for an interrupt, for cli, with `{finished}` and, if given, `{total}`.
#' @param count_finished A function that returns the number of finished units, or a text.
#' @return Whether there was an interrupt, logical.
#' @noRd
until_interrupted <- function(play, text, count_finished, total = NULL) {
  interrupted <- FALSE
  tryCatch(play, interrupt = function(cnd) {
    interrupted <<- TRUE
    finished <- count_finished()
    cli::cli_inform(c("!" = text), class = "gym_message_interrupted")
  })
  interrupted
}

#' Show a progress bar until the calling function ends
#'
#' If the package progressr is loaded, its handlers are informed, too.
#' @param unit The unit, a word such as `"Round"`.
#' @param note The text before the remaining time.
#' @param shown Whether to show the bar.
#' @return A function of the number of finished units and the new `note`.
#' @noRd
progress_bar <- function(total, unit, note = "", shown = TRUE, frame = parent.frame()) {
  bar <- if (shown) {
    cli::cli_progress_bar(
      total = total, extra = list(note = note), .envir = frame,
      format = paste(unit, "{cli::pb_current} of {cli::pb_total} {cli::pb_bar}",
                     "{cli::pb_extra$note}{cli::pb_eta_str}")
    )
  }
  signals <- "progressr" %in% loadedNamespaces()
  progress <- if (signals) progressr::progressor(steps = total, envir = frame)
  updated <- signalled <- 0
  function(finished, note = "") {
    # A finished bar no longer exists.
    if (shown && updated < total) {
      updated <<- finished
      cli::cli_progress_update(set = finished, extra = list(note = note), id = bar, .envir = frame)
    }
    # Send at most a hundred signals, because each takes a while.
    amount <- finished - signalled
    if (signals && (amount >= total / 100 || finished >= total && amount > 0)) {
      progress(note, amount = amount)
      signalled <<- finished
    }
  }
}

# The error keeps the classes and fields of the original error. So code that handles a lost
# connection also works for one that was lost during play.
abort_with_result <- function(cnd, what, result, played, class, call, hint = NULL) {
  own <- c("message", "call", "parent", "trace", "body", "header", "footer", "rlang",
           "use_cli_format")
  fields <- unclass(cnd)[setdiff(names(cnd), own)]
  rlang::exec(
    gym_abort,
    c(paste0(what, " ended early, after ", played, "."),
      i = "The field `result` of this condition has the finished part.", i = hint),
    class = c(class, grep("^gym_error_", class(cnd), value = TRUE)), result = result, !!!fields,
    parent = cnd, call = call
  )
}

# Policies with a program of their own -----------------------------------------------------------

# Some policies play whole episodes in a program of their own, which also makes the environment. An
# example is a policy that only Stable-Baselines3 can run.

#' Play whole episodes with a policy that has a program of its own
#'
#' @param policy The policy, bound to the environment.
#' @param vector_env As passed on by [with_vector_env()].
#' @param episodes A list of vectors with an element for each episode, as for [play_batch()].
#' @param keep What to keep of the steps, a character vector of `"steps"` and `"next_observation"`.
#' @param report A function that is called with the number of finished episodes.
#' @return A list: `batch`, as returned by [play_batch()], for the first episodes or all; `error`,
#'   the condition that ended it early, or `NULL`; and `interrupted`, whether an interrupt did.
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

# Plays one candidate after the other.
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
