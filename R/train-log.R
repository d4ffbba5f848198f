# The log of a training: a folder with two tables that grow, and what was trained.

# The columns of progress.csv, as Stable-Baselines3 names them
# (https://stable-baselines3.readthedocs.io/en/master/common/logger.html).
log_columns <- c(
  "time/iterations", "time/total_timesteps", "time/time_elapsed", "time/fps",
  "rollout/ep_rew_mean", "rollout/ep_rew_min", "rollout/ep_rew_median", "rollout/ep_rew_max",
  "rollout/ep_len_mean", "eval/mean_reward", "eval/mean_ep_length"
)

# The table's lines for these iterations; the first line has the column names.
log_lines <- function(state, iterations) {
  rows <- rows_table(state$history[iterations], no_iterations)
  evaluations <- rows_table(state$evaluations, no_evaluations)
  # Of several evaluations in an iteration, the last counts, which had the most episodes.
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

# A row for each evaluation from this one on.
evaluation_lines <- function(state, from = 1L) {
  history <- rows_table(state$history, no_iterations)
  rows <- rows_table(state$evaluations[seq_len(length(state$evaluations)) >= from], no_evaluations)
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
#' The table is written completely when training begins or resumes, so that it agrees with the
#' history, and after a line could not be written. Otherwise lines are appended.
#' @param state The training as it begins or resumes.
#' @return A function that is called after each iteration.
#' @noRd
training_log <- function(folder, settings, state, call) {
  table <- file.path(folder, "progress.csv")
  evaluations <- file.path(folder, "evaluations.csv")
  write_all <- function() {
    replace_content(table, as_lines(log_lines(state, seq_len(state$iteration))))
    replace_content(evaluations, as_lines(evaluation_lines(state)))
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
      if (state$iteration == 0L) for (file in c(table, evaluations)) keep_as_earlier(file)
      write_all()
    },
    error = fail, warning = fail
  )
  logged <- state$iteration
  evaluated <- length(state$evaluations)
  whole <- TRUE
  failed <- FALSE
  function() {
    new <- log_lines(state, seq_len(state$iteration - logged) + logged)[-1L]
    new_evaluations <- evaluation_lines(state, evaluated + 1L)[-1L]
    logged <<- state$iteration
    evaluated <<- length(state$evaluations)
    # Do not stop a long training because the disk is full.
    tryCatch(
      {
        if (whole) {
          append_lines(table, new)
          append_lines(evaluations, new_evaluations)
        } else {
          write_all()
        }
        whole <<- TRUE
      },
      error = function(cnd) {
        whole <<- FALSE
        if (!failed) {
          rlang::warn(
            c(paste0("The log \"", table, "\" cannot be written; the training continues without ",
                     "it."), x = conditionMessage(cnd)),
            class = "gym_warning_log"
          )
        }
        failed <<- TRUE
      }
    )
  }
}

append_lines <- function(table, lines) {
  if (length(lines)) write_bytes(table, as_lines(lines), "ab")
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
