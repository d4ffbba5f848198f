# A search keeps what it has played in a file, the checkpoint, from which it can go on after it was
# ended.

#' Prepare to keep a search or a training in a file
#'
#' @param path The file.
#' @param arguments What fixes it, a list, in which the file must agree.
#' @param resume Whether to go on with what the file has.
#' @param what What is kept, `"search"` or `"training"`.
#' @return A list: `path`, `arguments` and `saved`, what the file has, `NULL` where there is none to
#'   go on with.
#' @noRd
open_checkpoint <- function(path, arguments, resume, what = "search",
                            call = rlang::caller_env()) {
  # The working directory may have changed when the next batch has ended.
  path <- normalizePath(path, mustWork = FALSE)
  if (dir.exists(path) || !dir.exists(dirname(path))) {
    problem <- if (dir.exists(path)) "is a folder" else "is in a folder that does not exist"
    abort_checkpoint(path, problem, call = call)
  }
  remove_parts(path)
  saved <- if (resume) read_checkpoint(path, call)
  if (!is.null(saved)) {
    if (!identical(saved$what, what)) {
      abort_checkpoint(path, paste("is that of a", saved$what), call = call)
    }
    check_same_search(path, saved$arguments, arguments, what, call)
  }
  list(path = path, arguments = arguments, saved = saved)
}

# What must be the same in two runs of one search. Policies are compared by what is drawn from them,
# not by the weights that they have.
search_arguments <- function(env, settings) {
  double <- function(x) if (!is.null(x)) as.numeric(x)
  list(
    env = environment_traits(env),
    policy = with_generator(new_generator(1), policy_resample(settings$policy)),
    rounds = settings$rounds, episodes = settings$episodes,
    target = double(settings$target), max_steps = double(settings$max_steps),
    seed = double(settings$seed)
  )
}

environment_traits <- function(env) {
  if (is.character(env)) {
    list(env_id = env)
  } else if (inherits(env, "gym_wrapped")) {
    list(env_id = env$env_id, wrappers = env$wrappers)
  } else {
    list(
      env_id = env$spec$id, num_envs = env$num_envs,
      own_implementation = identical(env$vectorization_mode, "vector_entry_point"),
      autoreset_mode = env$autoreset_mode
    )
  }
}

# The same search ------------------------------------------------------------------

check_same_search <- function(path, there, here, what, call) {
  differ <- Filter(function(name) !is_same(there[[name]], here[[name]]), names(here))
  if (length(differ)) {
    lines <- vapply(differ, function(name) {
      texts <- c(argument_text(name, there[[name]]), argument_text(name, here[[name]]))
      if (texts[[1L]] == texts[[2L]]) {
        paste0("`", name, "` is another there.")
      } else {
        paste0("`", name, "` is ", texts[[1L]], " there, and ", texts[[2L]], " here.")
      }
    }, "")
    abort_checkpoint(path, paste("is that of another", what), lines, call, argument = differ)
  }
}

is_same <- function(x, y) {
  identical(x, y, ignore.bytecode = TRUE, ignore.environment = TRUE, ignore.srcref = TRUE)
}

argument_text <- function(name, value) {
  switch(
    name,
    env = paste0(value$env_id, if (!is.null(value$num_envs)) {
      paste0(" with ", count_of(value$num_envs, "sub-environment"))
    }),
    policy = policy_text(value),
    agent = format(value),
    if (is.numeric(value)) number_text(value) else describe_value(value)
  )
}

# Another server may run the sub-environments in another way, and with it play other episodes.
check_same_server <- function(path, there, now, call) {
  differ <- Filter(function(name) !is_same(there[[name]], now[[name]]), names(now))
  if (length(differ)) {
    lines <- vapply(differ, function(name) {
      what <- switch(
        name, target = "the environment's reward threshold", env_id = "the environment",
        batch_size = "how many episodes make a batch",
        num_envs = "how many sub-environments there are"
      )
      paste0("There ", what, " is ", describe_value(there[[name]]), ", and ",
             describe_value(now[[name]]), " on this server.")
    }, "")
    abort_checkpoint(path, "is from a server that played otherwise", lines, call)
  }
}

abort_checkpoint <- function(path, problem, lines = NULL, call, ...) {
  gym_abort(
    c(
      paste0("The checkpoint \"", path, "\" ", problem, "."),
      if (length(lines)) stats::setNames(lines, rep("x", length(lines))),
      i = paste(
        "Give another file as `checkpoint`; `resume = FALSE` begins anew and replaces what is",
        "there."
      )
    ),
    class = c("gym_error_checkpoint", "gym_error_argument"),
    path = path, ..., call = call
  )
}

# Resuming -------------------------------------------------------------------------

#' Go on with a search from its file
#' @noRd
resume_history <- function(history, saved, vector_env, settings, path, call) {
  check_same_server(path, saved$server, settings_of_server(vector_env, settings), call)
  restore_history(history, saved)
  finished <- length(history$means)
  inform_resumed("Going on from {.path {path}}, with {finished} of {settings$rounds} round{?s}.")
}

# Settings that the server decides, beside the arguments.
settings_of_server <- function(vector_env, settings) {
  list(
    target = settings$target, env_id = settings$env_id, num_envs = settings$num_envs,
    batch_size = vector_env$batch_size
  )
}

#' Put the history of a search back to where its file has it
#' @param history As [new_candidate_history()] returns it.
#' @return The history, with what was played.
#' @noRd
restore_history <- function(history, saved) {
  list2env(saved$history, history)
  history$streams <- restore_streams(saved$streams)
  history$on_finished(length(history$means), history$best$mean)
  history
}

# Says that a part of the result comes from an earlier run.
inform_resumed <- function(text, .envir = parent.frame()) {
  cli::cli_inform(c(i = text), class = "gym_message_resumed", .envir = .envir)
}

#' Make the result of a search whose file says that it had ended
#' @noRd
finished_search <- function(saved, settings, client, path) {
  inform_resumed(
    "This search had ended: {.path {path}} has its result. {.code resume = FALSE} plays it anew."
  )
  settings[names(saved$server)] <- saved$server
  settings["client"] <- list(client)
  settings$policy <- saved$policy
  settings$seed <- saved$seed
  history <- new_candidate_history(
    settings$rounds, settings$episodes, settings$target, NULL, function(...) NULL
  )
  restore_history(history, saved)
  new_search(history, saved$template, settings, proc.time()[["elapsed"]] - saved$elapsed)
}

# Writing --------------------------------------------------------------------------

#' Keep a search in its file from now on
#'
#' The file is written anew after each batch of episodes. It grows, and where a batch is a single
#' episode, writing might take longer than playing: then it is not written after each batch, and
#' the episodes since the last time would be played again.
#' @param history As [new_candidate_history()] returns it.
#' @param template The policy of which candidates are drawn, bound to the environment.
#' @param started When the search began, minus the time that it took before.
#' @noRd
keep_history <- function(history, template, checkpoint, vector_env, settings, started, call) {
  state <- function() {
    list(
      what = "search", arguments = checkpoint$arguments,
      server = settings_of_server(vector_env, settings), policy = settings$policy,
      template = template, seed = settings$seed, history = saved_history(history),
      streams = saved_streams(history$streams), elapsed = proc.time()[["elapsed"]] - started,
      finished = is_finished(history)
    )
  }
  write <- checkpoint_writer(checkpoint, state, "search", call)
  history$keep <- function() {
    write(now = vector_env$batch_size > 1L || is_finished(history))
  }
}

is_finished <- function(history) {
  history$ended || length(history$means) >= history$candidates
}

# The file is written between batches, when no episode is under way.
saved_history <- function(history) {
  columns <- c("candidate", "episode", "seed", "sub_env", "return", "length", "terminated",
               "truncated")
  together <- lapply(stats::setNames(nm = columns), function(name) {
    unlist(lapply(history$batches, function(batch) batch[[name]]))
  })
  kept <- c("played_batches", "means", "unfinished", "best", "weights", "ended", "seeds")
  c(mget(kept, history), list(batches = list(together)))
}
