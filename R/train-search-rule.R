# The rule by which search_random() ends, that of the post: candidates, which are rounds there, are
# judged in their order by the episodes that they have played, and the first whose mean return
# reaches the target ends the search.

#' Check what a search is to do
#'
#' `policy` must not have been evaluated before: if it draws its weights, the generator is put back
#' afterwards.
#' @return A list, as [play_search()] takes it, without what the environment adds.
#' @noRd
search_settings <- function(env, policy, rounds, episodes, target, max_steps,
                            call = rlang::caller_env()) {
  check_environment(env, call = call)
  check_count(rounds, call = call)
  check_count(episodes, call = call)
  check_number(target, allow_null = TRUE, call = call)
  check_count(max_steps, allow_null = TRUE, call = call)
  keep_random_state(policy_resample(check_policy(policy, call = call), call = call))
  structure(
    list(
      what = "search", policy = policy, rounds = as.integer(rounds),
      episodes = as.integer(episodes), target = target, max_steps = max_steps,
      keep_episodes = TRUE
    ),
    class = "gym_search_settings"
  )
}

# Completes the settings with those of the environment.
settings_in <- function(vector_env, settings) {
  settings["target"] <- list(settings$target %||% vector_env$spec$reward_threshold)
  # Candidates after one that has reached it need not be played.
  settings["last_target"] <- settings["target"]
  settings["num_envs"] <- list(vector_env$num_envs)
  settings["client"] <- list(vector_env$client)
  settings$env_id <- environment_label(vector_env)
  settings
}

#' Search in an environment that was made
#' @param agent An agent that has begun, as [agent_start()] returns it.
#' @param settings As [settings_in()] returns them.
#' @param file As [open_checkpoint()] returns it, or `NULL`.
#' @return A search, as [search_result()] makes it.
#' @noRd
play_search <- function(agent, vector_env, settings, progress, call, file = NULL) {
  settings$provenance <- file$saved$provenance %||% new_provenance(vector_env, settings)
  state <- new_training(agent, settings)
  state$checkpoint <- training_checkpoint(state, file, settings, vector_env, call)
  run_training(state, vector_env, settings, progress, call)
}

#' @exportS3Method
is_used_up.gym_search_settings <- function(settings, state) {
  state$agent$played >= settings$rounds
}

# An iteration has as many rounds as a batch of episodes has room for.
#' @exportS3Method
agent_to_ask.gym_search_settings <- function(settings, state, vector_env) {
  agent <- state$agent
  left <- settings$rounds - agent$played
  room <- if (length(vector_env$remembers)) Inf else vector_env$batch_size %/% settings$episodes
  agent$candidates <- as.integer(max(1, min(left, room)))
  agent
}

#' @exportS3Method
seed_drawer.gym_search_settings <- function(settings) draw_environment_seeds

#' @exportS3Method
training_ends.gym_search_settings <- function(settings, state, vector_env) {
  any(vapply(state$results$returns, reaches, NA, target = settings$target))
}

#' @exportS3Method
finish_training.gym_search_settings <- function(settings, state, vector_env) NULL

#' @exportS3Method
played_text.gym_search_settings <- function(settings, state, of_all = FALSE) {
  played <- state$agent$played
  if (of_all) paste(played, "of", count_of(settings$rounds, "round")) else count_of(played, "round")
}

#' @exportS3Method
training_progress.gym_search_settings <- function(settings, state, progress,
                                                  frame = parent.frame()) {
  bar <- progress_bar(
    settings$rounds, "Round", "best mean return -, ", shown = progress, frame = frame
  )
  show <- function(episodes) {
    best <- state$agent$best_return
    note <- if (is.finite(best)) number_text(best) else "-"
    finished <- state$agent$played + episodes %/% settings$episodes
    bar(finished, paste0("best mean return ", note, ", "))
  }
  state$report <- show
  if (state$agent$played) show(0)
  function(state) show(0)
}

#' @exportS3Method
training_result.gym_search_settings <- function(settings, state, interrupted = FALSE) {
  search_result(settings, state, interrupted)
}
