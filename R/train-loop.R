# The loop that plays a search: what it is to do, its progress, an interrupt, an error.

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
  list(
    policy = policy, rounds = as.integer(rounds), episodes = as.integer(episodes),
    target = target, max_steps = max_steps
  )
}

# Completes the settings with those of the environment.
settings_in <- function(vector_env, settings) {
  settings["target"] <- list(settings$target %||% vector_env$spec$reward_threshold)
  settings["num_envs"] <- list(vector_env$num_envs)
  settings["client"] <- list(vector_env$client)
  settings$env_id <- environment_label(vector_env)
  settings
}

#' Play candidates until one reaches the target
#'
#' An interrupt ends the search early; so does an error, which carries what was played.
#' @param template The policy, bound to the environment, of which candidates are drawn.
#' @param settings As [settings_in()] returns them.
#' @param checkpoint As [open_checkpoint()] returns it, or `NULL`.
#' @return A search, as [new_search()] makes it.
#' @noRd
play_search <- function(vector_env, template, settings, progress, call, checkpoint = NULL) {
  started <- proc.time()[["elapsed"]]
  show <- search_progress(settings$rounds, progress)
  history <- new_candidate_history(
    settings$rounds, settings$episodes, settings$target, new_streams(settings$seed), show
  )
  finished <- function() length(history$means)
  if (!is.null(checkpoint)) {
    saved <- checkpoint$saved
    if (!is.null(saved)) {
      started <- started - saved$elapsed
      resume_history(history, saved, vector_env, settings, checkpoint$path, call)
    }
    keep_history(history, template, checkpoint, vector_env, settings, started, call)
  }
  interrupted <- tryCatch(
    until_interrupted(
      play_batches(
        vector_env, history, function(candidates) draw_candidates(history, template, candidates),
        after = after_search_batch,
        report = function(ended) {
          show(finished() + (length(history$unfinished) + ended) %/% history$episodes,
               history$best$mean)
        },
        max_steps = settings$max_steps %||% Inf, target = settings$target
      ),
      "The search was interrupted after {finished} of {total} round{?s};
       it returns what it has so far.",
      finished, settings$rounds
    ),
    error = function(cnd) {
      abort_search(
        cnd, new_search(history, template, settings, started), call, checkpoint = checkpoint$path
      )
    }
  )
  new_search(history, template, settings, started, interrupted)
}

after_search_batch <- function(history, played) {
  history$ended <- enter_returns(history, played)
  history$keep()
  history$ended
}

# A function of how many rounds have finished and the best mean return so far, `NULL` for none.
search_progress <- function(rounds, progress, frame = parent.frame()) {
  if (!progress) {
    return(function(finished, best) NULL)
  }
  bar <- progress_bar(rounds, "Round", "best mean return -, ", frame)
  function(finished, best) {
    bar(finished, paste0("best mean return ", if (is.null(best)) "-" else number_text(best), ", "))
  }
}

abort_search <- function(cnd, result, call, played = count_of(nrow(result$rounds), "round"),
                         checkpoint = NULL) {
  hint <- if (!is.null(checkpoint)) {
    paste0("The same call goes on from \"", checkpoint, "\" when what is wrong is fixed.")
  }
  abort_with_result(cnd, "The search", result, played, "gym_error_search", call, hint)
}
