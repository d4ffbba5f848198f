# The rule by which train_agent() ends: evaluations of the agent's own policy.

# Seeds of episodes: those of training are up to this number, those of evaluations above it; of
# these the final evaluation has the upper half. So an evaluation plays no episode that the training
# has seen, and the final one none that any has.
last_training_seed <- 2^30

# How many episodes make a point of the learning curve.
curve_episodes <- 10L

#' @exportS3Method
is_used_up.gym_training_settings <- function(settings, state) {
  state$iteration >= (settings$iterations %||% Inf) || state$steps >= (settings$steps %||% Inf)
}

#' @exportS3Method
agent_to_ask.gym_training_settings <- function(settings, state, vector_env) state$agent

#' @exportS3Method
seed_drawer.gym_training_settings <- function(settings) {
  function(n) sample.int(last_training_seed, n, replace = TRUE)
}

#' @exportS3Method
training_ends.gym_training_settings <- function(settings, state, vector_env) {
  reached <- reaches(state$history[[state$iteration]]$mean_return, settings$target)
  if (!reached && state$iteration %% settings$eval_every == 0) {
    episodes <- min(curve_episodes, settings$eval_episodes)
    curve <- evaluate_agent(state, vector_env, settings, "curve", episodes)
    reached <- reaches(curve$mean_return, settings$target)
  }
  if (reached) {
    stopping <- evaluate_agent(state, vector_env, settings, "stopping", settings$eval_episodes)
    state$solved <- reaches(stopping$mean_return, settings$target)
  }
  state$solved
}

#' @exportS3Method
finish_training.gym_training_settings <- function(settings, state, vector_env) {
  if (is.null(state$final)) {
    state$final <- evaluate_agent(state, vector_env, settings, "final", settings$eval_episodes)
    state$checkpoint(last = TRUE)
  }
}

#' Evaluate the agent's policy: in fresh episodes, or exactly where it is judged by a model
#' @param kind What for: `"curve"`, `"stopping"` or `"final"`.
#' @return A row of the training's evaluations.
#' @noRd
evaluate_agent <- function(state, vector_env, settings, kind, episodes) {
  policy <- agent_policy(state$agent)
  final <- kind == "final"
  exact <- if (!is.null(settings$model)) {
    evaluate_exactly(settings$model, policy, settings$max_steps)
  }
  played <- exact %||% play_evaluation(state, vector_env, settings, policy, episodes, final)
  row <- cbind(data.frame(iteration = state$iteration, kind = kind), played[-1L])
  row.names(row) <- NULL
  state$evaluations[[length(state$evaluations) + 1L]] <- row
  if (state$iteration > 0L && !final) {
    state$history[[state$iteration]]$evaluation <- row$mean_return
  }
  row
}

play_evaluation <- function(state, vector_env, settings, policy, episodes, final) {
  # The final evaluation draws from copies: a training that goes on with a larger budget evaluates
  # as one that had it from the start.
  streams <- state$evaluation_streams
  if (final) streams <- restore_streams(saved_streams(streams))
  half <- last_training_seed / 2
  before <- last_training_seed + if (final) half - 1 else 0
  history <- new_history(1L, episodes, streams)
  history$draw_seeds <- function(n) as.integer(before + sample.int(half - 1, n, replace = TRUE))
  play_batches(
    vector_env, history, function(which) policy, max_steps = settings$max_steps %||% Inf
  )
  evaluate_episodes(episodes_table(history$batches), policy)
}

# Showing ------------------------------------------------------------------------------

#' @exportS3Method
played_text.gym_training_settings <- function(settings, state, of_all = FALSE) {
  count_of(state$iteration, "iteration")
}

#' @exportS3Method
training_progress.gym_training_settings <- function(settings, state, progress,
                                                    frame = parent.frame()) {
  by_steps <- is.null(settings$iterations)
  bar <- progress_bar(
    settings$iterations %||% settings$steps, if (by_steps) "Step" else "Iteration",
    shown = progress, frame = frame
  )
  function(state) {
    row <- state$history[[state$iteration]]
    evaluated <- if (length(state$evaluations)) {
      state$evaluations[[length(state$evaluations)]]$mean_return
    }
    bar(
      if (by_steps) min(state$steps, settings$steps) else state$iteration,
      paste0(
        "median ", number_text(row$median_return), ", best ", number_text(row$max_return),
        if (!is.null(evaluated)) paste0(", evaluation ", number_text(evaluated)),
        ", ", number_text(row$steps / max(row$elapsed, 1e-3)), " steps/s, ",
        workers_note()
      )
    )
  }
}
