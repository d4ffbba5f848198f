# What a training keeps in its file, and how it goes on from there.

kept_of_training <- c(
  "agent", "iteration", "steps", "history", "evaluations", "final", "solved", "ended"
)

#' Go on from a training's file, and keep the training in it from now on
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
    resume_training(state, checkpoint$saved, settings, checkpoint$path)
  }
  state$path <- checkpoint$path
  write <- checkpoint_writer(checkpoint, function() {
    list(
      what = "training", arguments = checkpoint$arguments, server = server, seed = settings$seed,
      provenance = settings$provenance,
      training = mget(kept_of_training, state), streams = saved_streams(state$streams),
      evaluation_streams = saved_streams(state$evaluation_streams),
      elapsed = proc.time()[["elapsed"]] - state$started
    )
  }, "training", call)
  function(last = FALSE) write(now = last)
}

resume_training <- function(state, saved, settings, path) {
  list2env(saved$training, state)
  state$streams <- restore_streams(saved$streams)
  state$evaluation_streams <- restore_streams(saved$evaluation_streams)
  state$started <- state$started - saved$elapsed
  if (!state$ended && !is_used_up(state, settings)) {
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
