# The log of a training: a folder with a table that grows, and what was trained.

# The columns of progress.csv, as Stable-Baselines3 names them
# (https://stable-baselines3.readthedocs.io/en/master/common/logger.html).
log_columns <- c(
  "time/iterations", "time/total_timesteps", "time/time_elapsed", "time/fps",
  "rollout/ep_rew_mean", "rollout/ep_rew_min", "rollout/ep_rew_median", "rollout/ep_rew_max",
  "rollout/ep_len_mean", "eval/mean_reward", "eval/mean_ep_length"
)

log_row <- function(state) {
  row <- state$history[[state$iteration]]
  evaluated <- Filter(function(one) one$iteration == state$iteration, state$evaluations)
  last <- if (length(evaluated)) evaluated[[length(evaluated)]]
  values <- data.frame(
    row$iteration, row$steps, round(row$elapsed, 3), round(row$steps / max(row$elapsed, 1e-3)),
    row$mean_return, row$min_return, row$median_return, row$max_return,
    row$mean_length,
    if (is.null(last)) NA else last$mean_return,
    if (is.null(last) || is_exact(last)) NA else last$steps / last$episodes
  )
  rlang::set_names(values, log_columns)
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
  missing <- tryCatch(
    {
      dir.create(folder, showWarnings = FALSE, recursive = TRUE)
      write_config(file.path(folder, "config.json"), settings)
      keep_iterations(table, iteration)
    },
    error = function(cnd) abort_log(folder, cnd, call),
    warning = function(cnd) abort_log(folder, cnd, call)
  )
  if (missing > 0L) warn_incomplete(table, missing)
  failed <- FALSE
  cut <- FALSE
  function(state) {
    # A full disk must not end what has trained for hours.
    tryCatch(
      {
        if (cut) keep_iterations(table, Inf)
        cut <<- TRUE
        append_row(table, log_row(state))
        cut <<- FALSE
      },
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

warn_incomplete <- function(table, missing) {
  rlang::warn(
    c(paste0("The log \"", table, "\" lacks ", count_of(missing, "iteration"), "."),
      x = "Its lines were not written completely, as on a full disk, and are left out."),
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
  replace_content(file, as_lines(json))
}

as_lines <- function(lines) charToRaw(paste0(enc2utf8(lines), "\n", collapse = ""))

# In JSON an empty list would be an array.
empty_as_object <- function(values) if (length(values)) values else rlang::set_names(list())

plain_provenance <- function(from) {
  from <- unclass(from)
  from$started <- format(from$started, "%Y-%m-%dT%H:%M:%S%z")
  from[setdiff(names(from), c("elapsed", "seed", "kwargs", "env_id"))]
}

#' Take out of a log the lines of later iterations, and those that were not written completely
#' @return How many iterations are missing because their lines were not complete.
#' @noRd
keep_iterations <- function(table, iteration) {
  if (!file.exists(table)) {
    return(0L)
  }
  if (iteration == 0L) {
    # It is another training's.
    file.rename(table, free_name(table))
    return(0L)
  }
  lines <- readLines(table, warn = FALSE, skipNul = TRUE)
  complete <- are_complete(table, lines)
  # The first column counts iterations, and has no number in the first line.
  of_lines <- suppressWarnings(as.numeric(sub(",.*", "", lines)))
  kept <- complete & !is.na(of_lines) & of_lines <= iteration
  replace_content(table, as_lines(c(paste(log_columns, collapse = ","), lines[kept])))
  looked_for <- if (!all(complete) && is.finite(iteration)) seq_len(iteration)
  length(setdiff(looked_for, of_lines[kept]))
}

# A line that was cut has no end, or the next one was written behind it.
are_complete <- function(table, lines) {
  commas <- nchar(gsub("[^,]", "", lines, useBytes = TRUE))
  bytes <- readBin(table, "raw", file.size(table))
  ends <- identical(utils::tail(bytes, 1L), charToRaw("\n"))
  commas == length(log_columns) - 1L & (ends | seq_along(lines) < length(lines))
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
  lines <- utils::capture.output(with_decimal_point(utils::write.table(
    row, sep = ",", na = "", row.names = FALSE, col.names = first, quote = FALSE
  )))
  write_bytes(table, as_lines(lines), "ab")
}
