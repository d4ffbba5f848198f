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
    `eval/mean_ep_length` = if (is.null(last) || is_exact(last)) NA else last$steps / last$episodes,
    check.names = FALSE
  )
}

#' Prepare to log a training
#' @param iteration After which iteration the training goes on. Later rows, of iterations that a
#'   checkpoint did not have, are taken out.
#' @return A function that is called after each iteration.
#' @noRd
training_log <- function(folder, settings, iteration, call) {
  if (is.null(folder)) {
    return(function(state) NULL)
  }
  table <- file.path(folder, "progress.csv")
  tryCatch(
    {
      dir.create(folder, showWarnings = FALSE, recursive = TRUE)
      write_config(file.path(folder, "config.json"), settings)
      keep_iterations(table, iteration)
    },
    error = function(cnd) abort_log(folder, cnd, call),
    warning = function(cnd) abort_log(folder, cnd, call)
  )
  failed <- FALSE
  function(state) {
    # A full disk must not end what has trained for hours.
    tryCatch(
      append_row(table, log_row(state)),
      error = function(cnd) {
        if (!failed) warn_not_logged(table, cnd)
        failed <<- TRUE
      }
    )
  }
}

abort_log <- function(folder, cnd, call) {
  gym_abort(
    c(paste0("The log cannot be written to \"", folder, "\"."), x = conditionMessage(cnd),
      i = "Give another folder as `log`."),
    class = "gym_error_argument", argument = "log", value = folder, call = call
  )
}

warn_not_logged <- function(table, cnd) {
  rlang::warn(
    c(paste0("The log \"", table, "\" cannot be written; the training goes on without."),
      x = conditionMessage(cnd)),
    class = "gym_warning_log"
  )
}

write_config <- function(file, settings) {
  numbers <- c("iterations", "steps", "episodes", "target", "max_steps", "eval_every",
               "eval_episodes", "seed")
  config <- c(
    list(
      agent = format(settings$agent), env = settings$env_id,
      kwargs = empty_as_object(settings$kwargs),
      policy = if (is.null(settings$policy)) "the learner's own" else policy_text(settings$policy)
    ),
    unclass(settings)[numbers],
    list(provenance = plain_provenance(settings$provenance))
  )
  json <- with_decimal_point(jsonlite::toJSON(
    config, auto_unbox = TRUE, pretty = TRUE, null = "null", digits = NA, force = TRUE
  ))
  writeLines(json, file)
}

# In JSON an empty list would be an array.
empty_as_object <- function(values) if (length(values)) values else rlang::set_names(list())

plain_provenance <- function(from) {
  from <- unclass(from)
  from$started <- format(from$started, "%Y-%m-%dT%H:%M:%S%z")
  from[setdiff(names(from), c("elapsed", "seed", "kwargs", "env_id"))]
}

keep_iterations <- function(table, iteration) {
  if (!file.exists(table)) {
    return(invisible())
  }
  if (iteration == 0L) {
    # It is another training's.
    return(invisible(file.rename(table, free_name(table))))
  }
  lines <- readLines(table)
  # The first column counts iterations; the first line has the columns' names.
  of_lines <- suppressWarnings(as.numeric(sub(",.*", "", lines)))
  writeLines(lines[is.na(of_lines) | of_lines <= iteration], table)
}

# "progress-1.csv" for "progress.csv", or the first such name that is free.
free_name <- function(file) {
  number <- 1L
  while (file.exists(name <- sub("[.]csv$", paste0("-", number, ".csv"), file))) {
    number <- number + 1L
  }
  name
}

append_row <- function(table, row) {
  first <- !file.exists(table)
  # Numbers with as many digits as they need and without an exponent, and nothing for what was not
  # evaluated.
  old <- options(scipen = 15)
  on.exit(options(old))
  withCallingHandlers(
    with_decimal_point(utils::write.table(
      row, table, append = !first, sep = ",", na = "", row.names = FALSE, col.names = first,
      quote = FALSE
    )),
    # The warning says more than the error that follows.
    warning = function(cnd) stop(conditionMessage(cnd), call. = FALSE)
  )
}
