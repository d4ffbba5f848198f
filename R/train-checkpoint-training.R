# What a training or a search keeps in its file, and how it goes on from there.

kept_of_training <- c(
  "agent", "iteration", "steps", "history", "evaluations", "episodes", "final", "solved", "ended"
)

#' Go on from a training's file, and keep the training in it from now on
#'
#' The file grows, and where iterations are short writing might take longer than playing: then it is
#' not written after each, and those since the last time would be played again. Only a search in a
#' vector environment writes after each of its batches.
#' @param checkpoint As [open_checkpoint()] returns it, `NULL` for none.
#' @return A function that is called after each iteration, and at the end with `last = TRUE`.
#' @noRd
training_checkpoint <- function(state, checkpoint, settings, vector_env, call) {
  if (is.null(checkpoint)) {
    return(function(last = FALSE) NULL)
  }
  settings["num_envs"] <- list(vector_env$num_envs)
  server <- settings_of_server(vector_env, settings)
  if (!is.null(checkpoint$saved)) {
    check_same_server(checkpoint$path, checkpoint$saved$server, server, call)
    resume_training(state, checkpoint$saved)
    go_on(settings, state, checkpoint$path)
  }
  state$path <- checkpoint$path
  write <- checkpoint_writer(checkpoint, function() {
    list(
      what = settings$what, arguments = checkpoint$arguments, server = server,
      policy = settings$policy, seed = settings$seed, provenance = settings$provenance,
      training = mget(kept_of_training, state), streams = saved_streams(state$streams),
      evaluation_streams = saved_streams(state$evaluation_streams),
      elapsed = proc.time()[["elapsed"]] - state$started,
      finished = state$ended || is_used_up(settings, state)
    )
  }, settings$what, call)
  often <- isTRUE(settings$keep_episodes) && vector_env$batch_size > 1L
  function(last = FALSE) {
    write(now = last || often || isTRUE(settings$keep_episodes) && is_used_up(settings, state))
  }
}

resume_training <- function(state, saved) {
  list2env(saved$training, state)
  state$streams <- restore_streams(saved$streams)
  state$evaluation_streams <- restore_streams(saved$evaluation_streams)
  state$started <- state$started - saved$elapsed
}

# Says from where it goes on.
go_on <- function(settings, state, path) UseMethod("go_on")

#' @exportS3Method
go_on.gym_search_settings <- function(settings, state, path) {
  finished <- state$agent$played
  inform_resumed("Going on from {.path {path}}, with {finished} of {settings$rounds} round{?s}.")
}

#' @exportS3Method
go_on.gym_training_settings <- function(settings, state, path) {
  if (!state$ended && !is_used_up(settings, state)) {
    # The budget is a larger one now.
    state$final <- NULL
    state$evaluations <- Filter(function(row) row$kind != "final", state$evaluations)
  }
  if (is.null(state$final)) {
    inform_resumed("Going on from {.path {path}}, after {state$iteration} iteration{?s}.")
  } else {
    inform_resumed(
      "This training had ended: {.path {path}} has its result. {.code resume = FALSE} trains anew."
    )
  }
}

#' Make the result of a search whose file says that it had ended
#' @param client The client that the result names.
#' @noRd
finished_search <- function(saved, settings, client, path) {
  inform_resumed(
    "This search had ended: {.path {path}} has its result. {.code resume = FALSE} plays it anew."
  )
  settings[names(saved$server)] <- saved$server
  settings["client"] <- list(client)
  settings$policy <- saved$policy
  settings$seed <- saved$seed
  settings$provenance <- saved$provenance
  state <- rlang::env(started = proc.time()[["elapsed"]])
  resume_training(state, saved)
  search_result(settings, state)
}
