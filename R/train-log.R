# The log of a training: a folder with a table that grows, and what was trained.

# The columns of progress.csv, as Stable-Baselines3 names them
# (https://stable-baselines3.readthedocs.io/en/master/common/logger.html).
log_row <- function(state) {
  row <- state$history[[state$iteration]]
  evaluated <- Filter(function(one) one$iteration == state$iteration, state$evaluations)
  last <- if (length(evaluated)) evaluated[[length(evaluated)]]
  data.frame(
    `time/iterations` = row$iteration,
    `time/total_timesteps` = row$steps,
    `time/time_elapsed` = round(row$elapsed, 3),
    `time/fps` = round(row$steps / max(row$elapsed, 1e-3)),
    `rollout/ep_rew_mean` = row$mean_return,
    `rollout/ep_rew_min` = row$min_return,
    `rollout/ep_rew_median` = row$median_return,
    `rollout/ep_rew_max` = row$max_return,
    `rollout/ep_len_mean` = row$mean_length,
    `eval/mean_reward` = if (is.null(last)) NA else last$mean_return,
    `eval/mean_ep_length` = if (is.null(last)) NA else last$steps / last$episodes,
    check.names = FALSE
  )
}

#' Prepare to log a training
#' @return A function that is called after each iteration.
#' @noRd
training_log <- function(folder, settings, call) {
  if (is.null(folder)) {
    return(function(state) NULL)
  }
  folder <- normalizePath(folder, mustWork = FALSE)
  if (!dir.exists(folder) && !suppressWarnings(dir.create(folder, recursive = TRUE))) {
    abort_argument(folder, "a folder that can be made", "log", call)
  }
  config <- list(
    agent = format(settings$agent), env = settings$env_id, policy = policy_text(settings$policy),
    iterations = settings$iterations, steps = settings$steps, episodes = settings$episodes,
    target = settings$target, max_steps = settings$max_steps, eval_every = settings$eval_every,
    eval_episodes = settings$eval_episodes, seed = settings$seed
  )
  writeLines(
    jsonlite::toJSON(config, auto_unbox = TRUE, pretty = TRUE, null = "null", digits = NA),
    file.path(folder, "config.json")
  )
  table <- file.path(folder, "progress.csv")
  function(state) {
    first <- !file.exists(table) || state$iteration == 1L
    # Numbers with as many digits as they need, and nothing for what was not evaluated.
    utils::write.table(
      log_row(state), table, append = !first, sep = ",", na = "", row.names = FALSE,
      col.names = first, qmethod = "double"
    )
  }
}
