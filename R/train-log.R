# The log of a training: a folder with two tables that grow, and a file that says what was trained.

# The columns of progress.csv, as Stable-Baselines3 names them
# (https://stable-baselines3.readthedocs.io/en/master/common/logger.html).
log_columns <- c(
  "time/iterations", "time/total_timesteps", "time/time_elapsed", "time/fps",
  "rollout/ep_rew_mean", "rollout/ep_rew_min", "rollout/ep_rew_median", "rollout/ep_rew_max",
  "rollout/ep_len_mean", "eval/mean_reward", "eval/mean_ep_length"
)

# The lines of progress.csv from this iteration on. The first line has the column names.
log_lines <- function(state, from) {
  rows <- rows_table(state$history[seq_along(state$history) >= from], no_iterations)
  evaluations <- rows_table(state$evaluations, no_evaluations)
  # If an iteration has several evaluations, the last one counts: it has the most episodes.
  evaluations <- evaluations[!duplicated(evaluations$iteration, fromLast = TRUE), ]
  evaluated <- evaluations[match(rows$iteration, evaluations$iteration), ]
  length <- evaluated$steps / evaluated$episodes
  # An evaluation by a model has no episodes.
  length[!is.finite(length)] <- NA
  table <- data.frame(
    rows$iteration, rows$steps, round(rows$elapsed, 3),
    round(rows$steps / pmax(rows$elapsed, 1e-3)), rows$mean_return, rows$min_return,
    rows$median_return, rows$max_return, rows$mean_length, evaluated$mean_return, length
  )
  of_agent <- names(agent_log(state$agent))
  # Before the first iteration there are only column names.
  if (!nrow(rows)) rows[of_agent] <- rep(list(numeric()), length(of_agent))
  csv_lines(rlang::set_names(
    cbind(table, rows[of_agent]), c(log_columns, paste0("train/", of_agent, recycle0 = TRUE))
  ))
}

# The lines of evaluations.csv from this evaluation on, in the same form.
evaluation_lines <- function(state, from) {
  history <- rows_table(state$history, no_iterations)
  rows <- rows_table(state$evaluations[seq_along(state$evaluations) >= from], no_evaluations)
  steps <- evaluation_steps(list(history = history, evaluations = rows))
  names(rows)[names(rows) == "steps"] <- "eval_steps"
  csv_lines(cbind(rows["iteration"], steps = steps, rows[-1L]))
}

# Numbers with as many digits as they need and without an exponent, and nothing for `NA`.
csv_lines <- function(table) {
  old <- options(scipen = 15)
  on.exit(options(old))
  utils::capture.output(with_decimal_point(
    utils::write.table(table, sep = ",", na = "", row.names = FALSE, quote = FALSE)
  ))
}

#' Prepare to log a training
#'
#' Both tables are written completely when training begins or resumes, so that they agree with the
#' history, and once more after a write has failed. Otherwise lines are appended.
#' @param state The training as it begins or resumes.
#' @return A function that is called after each iteration.
#' @noRd
training_log <- function(folder, settings, state, call) {
  tables <- file.path(folder, c("progress.csv", "evaluations.csv"))
  # The numbers of iterations and of evaluations in the tables. With `NULL` they are written anew.
  written <- NULL
  write <- function() {
    before <- written
    written <<- NULL
    rows <- c(state$iteration, length(state$evaluations))
    first <- (before %||% c(0L, 0L)) + 1L
    lines <- list(log_lines(state, first[[1L]]), evaluation_lines(state, first[[2L]]))
    for (i in 1:2) {
      if (is.null(before)) {
        replace_content(tables[[i]], as_lines(lines[[i]]))
      } else if (rows[[i]] >= first[[i]]) {
        write_bytes(tables[[i]], as_lines(lines[[i]][-1L]), "ab")
      }
    }
    written <<- rows
  }
  fail <- function(cnd) {
    abort_wrong(
      "log", folder, call, 'The log cannot be written to "{folder}".',
      x = conditionMessage(cnd), i = "Give another folder as `log`."
    )
  }
  tryCatch(
    {
      dir.create(folder, showWarnings = FALSE, recursive = TRUE)
      write_config(file.path(folder, "config.json"), settings)
      # Tables that exist when a training begins belong to another one.
      if (state$iteration == 0L) for (file in tables) keep_as_earlier(file)
      write()
    },
    error = fail, warning = fail
  )
  failed <- FALSE
  function() {
    # Do not stop a long training because the disk is full.
    tryCatch(
      write(),
      error = function(cnd) {
        if (!failed) {
          rlang::warn(
            c(paste0("The log \"", tables[[1L]], "\" cannot be written; the training continues ",
                     "without it."), x = conditionMessage(cnd)),
            class = "gym_warning_log"
          )
        }
        failed <<- TRUE
      }
    )
  }
}

write_config <- function(file, settings) {
  from <- unclass(settings$provenance)
  from$started <- format(from$started, "%Y-%m-%dT%H:%M:%S%z")
  numbers <- c("iterations", "total_steps", "episodes", "target", "max_steps", "eval_every",
               "eval_steps", "eval_episodes", "seed")
  config <- c(
    list(
      agent = format(settings$agent), env = settings$env_id,
      # In JSON an empty list without names would be an array.
      kwargs = if (length(settings$kwargs)) settings$kwargs else rlang::set_names(list()),
      policy = if (is.null(settings$policy)) "the learner's own" else policy_text(settings$policy)
    ),
    settings[numbers],
    list(provenance = from[setdiff(names(from), c("elapsed", "seed", "kwargs", "env_id"))])
  )
  json <- with_decimal_point(jsonlite::toJSON(
    config, auto_unbox = TRUE, pretty = TRUE, null = "null", digits = NA, force = TRUE
  ))
  replace_content(file, as_lines(json))
}

as_lines <- function(lines) charToRaw(paste0(enc2utf8(lines), "\n", collapse = ""))

# Renames "progress.csv" to "progress-1.csv", or to the first such name that is free.
keep_as_earlier <- function(file) {
  number <- 1L
  while (file.exists(name <- sub("[.]csv$", paste0("-", number, ".csv"), file))) {
    number <- number + 1L
  }
  if (file.exists(file)) file.rename(file, name)
}
