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
  show <- function(finished, best) NULL
  if (progress) {
    bar <- progress_bar(settings$rounds, "Round", "best mean return -, ")
    show <- function(finished, best) {
      bar(finished, paste0("best mean return ", number_text(best), ", "))
    }
  }
  history <- new_candidates(settings$rounds, settings$episodes, settings$target, show)
  if (!is.null(checkpoint)) {
    saved <- checkpoint$saved
    if (!is.null(saved)) {
      settings$policy <- saved$template
      started <- started - saved$elapsed
      resume_history(history, saved, vector_env, settings, checkpoint$path, call)
    }
    keep_history(history, checkpoint, vector_env, settings, started, call)
  }
  begin <- function(batch, episodes) {
    list(seeds = vector_env$draw_seeds(), policy = draw_policies(history, template, episodes))
  }
  interrupted <- tryCatch(
    until_interrupted(
      play_episodes(vector_env, history, begin, settings$max_steps),
      "The search was interrupted after {finished} of {total} round{?s};
       it returns what it has so far.",
      function() count_finished(history), settings$rounds
    ),
    error = function(cnd) {
      abort_search(
        cnd, new_search(history, settings, started), call, checkpoint = checkpoint$path
      )
    }
  )
  new_search(history, settings, started, interrupted)
}

#' Play until the end or an interrupt
#'
#' @param play Code that plays.
#' @param text A message for an interrupt, for cli, with `{finished}` and `{total}`.
#' @param count_finished A function that returns how many of the `total` are finished.
#' @return Whether there was an interrupt, logical.
#' @noRd
until_interrupted <- function(play, text, count_finished, total) {
  tryCatch(
    {
      play
      FALSE
    },
    interrupt = function(cnd) {
      finished <- count_finished()
      cli::cli_inform(c("!" = text), class = "gym_message_interrupted")
      TRUE
    }
  )
}

#' Show a progress bar until the calling function ends
#'
#' @param unit What is counted, a word such as `"Round"`.
#' @param note What stands before the time that is left.
#' @return A function of how many are finished and the new `note`.
#' @noRd
progress_bar <- function(total, unit, note = "", frame = parent.frame()) {
  bar <- cli::cli_progress_bar(
    total = total,
    format = paste(
      unit, "{cli::pb_current} of {cli::pb_total} {cli::pb_bar}",
      "{cli::pb_extra$note}{cli::pb_eta_str}"
    ),
    extra = list(note = note),
    .envir = frame
  )
  function(finished, note = "") {
    cli::cli_progress_update(
      id = bar, set = finished, extra = list(note = note), .envir = frame
    )
  }
}

# The error keeps the classes and fields of the one in the middle: code that expects a lost
# connection need not know that it was lost in a search.
abort_search <- function(cnd, result, call, played = count_of(nrow(result$rounds), "round"),
                         checkpoint = NULL) {
  own <- c("message", "call", "parent", "trace", "body", "header", "footer", "rlang",
           "use_cli_format")
  fields <- unclass(cnd)[setdiff(names(cnd), own)]
  rlang::exec(
    gym_abort,
    c(
      paste0("The search ended early, after ", played, "."),
      i = "What was played is the element `result` of this condition.",
      i = if (!is.null(checkpoint)) {
        paste0("The same call goes on from \"", checkpoint, "\" when what is wrong is fixed.")
      }
    ),
    class = c("gym_error_search", grep("^gym_error_", class(cnd), value = TRUE)),
    result = result,
    !!!fields,
    parent = cnd,
    call = call
  )
}
