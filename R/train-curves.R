#' Combine learning curves in one table
#'
#' Collect the evaluations of all trainings and seeds, from results and from log files.
#'
#' Files may come from other programs:
#'
#' * a folder with a log of this package (`train_agent(log = )`), or with such a folder for each
#'   seed;
#' * a folder of Stable-Baselines3 with `progress.csv` (from its logger): the evaluations
#'   (`eval/mean_reward`), or without them the episodes of `monitor.csv` files (from its Monitor, or
#'   `0.monitor.csv` and so on, ordered by time), or otherwise `rollout/ep_rew_mean`. You can also
#'   give such a file;
#' * CSV files of CleanRL's `charts/episodic_return`, as exported by Weights & Biases (a column for
#'   each run, or the history of one) or TensorBoard (`Wall time`, `Step`, `Value`); or a folder of
#'   them.
#'
#' The training returns in these programs' logs are not evaluations: actions are drawn, and the
#' returns are often means of the last 100 episodes. Their `kind` is `"training"`.
#'
#' @param ... Trainings of class `gym_training` or [gym_trainings], results of [sweep_agent()], and
#'   folders or files, strings. The name of an argument becomes its `training`; without a name it is
#'   that of the variable, the file, or the agent. In a sweep it is that of the setting.
#' @param at `NULL`, the default, or the numbers of steps at which to return all curves, for means
#'   over seeds. Between two evaluations the return is interpolated linearly. After its end a run
#'   counts with its last evaluation, as in [plot()][plot.gym_trainings()]. Before its first
#'   evaluation it has `NA`. The `kind` of these rows is `"interpolated"`.
#' @return A data frame with a row for each evaluation: `training`, `env_id` (strings, `NA` if the
#'   log does not have it), `seed` (a whole number; for other programs the one in a name such as
#'   `seed-3` or CleanRL's `CartPole-v1__ppo__3__1700000000`, otherwise the run's number),
#'   `iteration` (integer, 0 before the first, `NA` in logs of others), `steps` of the training,
#'   `mean_return` (doubles), `kind` (`"curve"`, `"stopping"`, `"final"` or `"training"`), `se`,
#'   `lower`, `upper` (its standard error and 95% interval, doubles, `NA` if unknown) and `episodes`
#'   (integer).
#' @section Errors: `gym_error_argument` for an object that is neither a training nor a log, for a
#'   damaged log, and for the result of [search_random()], which has no evaluations. If only some
#'   logs are damaged, they are left out with a warning, `gym_warning_log`.
#' @seealso [compare_trainings()], and [plot()][plot.gym_trainings()] for a picture.
#' @export
#' @examplesIf gym:::can_start_server()
#' ars <- train_agent(agent_ars(), "CartPole-v1", iterations = 10, eval_every = 5, seeds = 1:2)
#' learning_curves(ars)
learning_curves <- function(..., at = NULL) {
  call <- rlang::current_env()
  if (!is.null(at) && !(is.numeric(at) && all(is.finite(at) & at >= 0))) {
    abort_argument(at, "numbers of steps", "at", call)
  }
  given <- name_results(list(...), as.list(substitute(list(...)))[-1L])
  # Each setting of a sweep is a training with its own name.
  given <- do.call(c, unname(Map(function(x, label) {
    own <- if (inherits(x, "gym_sweep")) x$trainings else stats::setNames(list(x), label)
    Filter(Negate(is.null), own)
  }, given, names(given))))
  table <- do.call(rbind, c(list(cbind(training = character(), no_curve)), curves_of(given, call)))
  if (!is.null(at)) table <- curves_at(table, at)
  row.names(table) <- NULL
  table
}

curves_of <- function(trainings, call) {
  unname(Map(function(x, label) {
    rows <- curve_rows(x, label, call)
    cbind(training = rep(label, nrow(rows)), rows)
  }, trainings, names(trainings)))
}

# Returns all runs at the same numbers of steps.
curves_at <- function(table, at) {
  runs <- split_in_order(table, table$training, table$env_id, table$seed)
  each <- lapply(runs, function(own) {
    return <- returns_at(own, at)
    return[at < min(own$steps)] <- NA
    of_one <- no_curve[rep(NA_integer_, length(at)), ]
    of_one[c("env_id", "seed")] <- own[1L, c("env_id", "seed")]
    of_one[c("steps", "kind", "mean_return")] <- list(as.numeric(at), "interpolated", return)
    cbind(training = rep(own$training[[1L]], length(at)), of_one)
  })
  do.call(rbind, c(list(table[0L, ]), unname(each)))
}

# Interpolates the return between two evaluations. Before the first and after the last it stays the
# same. Of several evaluations at one step the last counts, because it had the most episodes.
returns_at <- function(curve, at) {
  curve <- curve[!duplicated(curve$steps, fromLast = TRUE), ]
  if (nrow(curve) == 1L) {
    rep(curve$mean_return, length(at))
  } else {
    stats::approx(curve$steps, curve$mean_return, at, rule = 2L)$y
  }
}

no_curve <- data.frame(
  env_id = character(), seed = numeric(), iteration = integer(), steps = numeric(),
  kind = character(), mean_return = numeric(), se = numeric(), lower = numeric(),
  upper = numeric(), episodes = integer()
)

curve_rows <- function(x, label, call) {
  if (inherits(x, "gym_trainings")) {
    do.call(rbind, c(list(no_curve), unname(lapply(x$trainings, curve_rows, label, call))))
  } else if (inherits(x, "gym_training")) {
    given_trainings(list(x), call)
    evaluations <- cbind(
      env_id = rep(x$env_id, nrow(x$evaluations)),
      seed = rep(as.numeric(x$seed), nrow(x$evaluations)), x$evaluations
    )
    evaluations$steps <- evaluation_steps(x)
    evaluations[names(no_curve)]
  } else if (rlang::is_string(x)) {
    if (!file.exists(x)) {
      abort_wrong("...", x, call, 'There is no file or folder "{x}".')
    }
    rows <- read_logs(x, call)[[1L]]
    abort_if(
      is.null(rows), "...", x, call, '"{x}" has no log of a training.',
      i = "A log is a folder of `train_agent(log = )`, `progress.csv` or `monitor.csv` of
           Stable-Baselines3, or a CSV file of CleanRL's `charts/episodic_return`.",
      i = if (endsWith(x, ".rds")) "For a saved result, give what `readRDS()` returns."
    )
    # Runs with unknown seeds are numbered.
    unknown <- is.na(rows$seed)
    rows$seed[unknown] <- match(rows$run[unknown], unique(rows$run))
    rows[names(no_curve)]
  } else {
    must <- "a training, or the folder or file of a log, a string"
    abort_argument(x, must, if (nzchar(label)) label else "...", call)
  }
}

# Reading logs --------------------------------------------------------------------------

# Learning curves from log files: our own, Stable-Baselines3's and CleanRL's.

#' Read files or folders, each by itself
#'
#' A crash may leave a damaged file. It must not hide the others, so it is left out with a warning.
#' If all files are damaged, the first one is an error.
#' @return A list of what `read` returned for those that are not damaged.
#' @noRd
read_logs <- function(paths, call, read = function(path) path_curves(path, call)) {
  each <- lapply(paths, function(path) {
    damaged <- function(cnd) {
      tryCatch(
        abort_wrong(
          "...", path, call, 'The log "{path}" is damaged.', x = conditionMessage(cnd)
        ),
        error = identity
      )
    }
    tryCatch(read(path), gym_error_argument = identity, error = damaged)
  })
  damaged <- vapply(each, inherits, NA, "gym_error_argument")
  if (length(each) && all(damaged)) rlang::cnd_signal(each[[1L]])
  for (cnd in each[damaged]) {
    rlang::warn(c(conditionMessage(cnd), i = "It is left out."), class = "gym_warning_log")
  }
  each[!damaged]
}

path_curves <- function(path, call) {
  if (dir.exists(path)) {
    return(folder_curves(path, call))
  }
  table <- file_table(path)
  if (has_episodes(table)) monitor_curves(table, path) else table
}

# The rows of a folder or of those below it, `NULL` if there is no log; `run` identifies the run.
folder_curves <- function(path, call) {
  inside <- function(name) file.path(path, name)
  if (file.exists(inside("config.json")) && file.exists(inside("evaluations.csv"))) {
    config <- jsonlite::read_json(inside("config.json"))
    rows <- utils::read.csv(inside("evaluations.csv"))
    return(run_rows(path, rows, env_id = config$env, seed = config$seed))
  }
  files <- c(inside("progress.csv"), list.files(path, "monitor[.]csv$", full.names = TRUE))
  tables <- read_logs(files[file.exists(files)], call, file_table)
  of_monitor <- vapply(tables, has_episodes, NA)
  progress <- do.call(rbind, tables[!of_monitor])
  episodes <- if (any(of_monitor)) monitor_curves(do.call(rbind, tables[of_monitor]), path)
  kinds <- list(if (any(progress$kind == "curve")) progress, episodes, progress)
  found <- Find(NROW, kinds) %||% Find(Negate(is.null), kinds)
  if (!is.null(found)) {
    return(found)
  }
  below <- c(list.files(path, "[.]csv$", full.names = TRUE), list.dirs(path, recursive = FALSE))
  do.call(rbind, read_logs(setdiff(below, files), call))
}

# The rows of a log file, or the episodes of a file of Monitor. `NULL` if the file is no log. The
# first line identifies the kind of file.
file_table <- function(file) {
  opened <- gzfile(file, "rb")
  # Files of saveRDS() contain zeros.
  is_text <- !any(readBin(opened, "raw", 1000L) == as.raw(0L))
  close(opened)
  lines <- if (is_text) readLines(file, warn = FALSE)
  if (!length(lines)) {
    return(NULL)
  }
  if (startsWith(lines[[1L]], "#")) {
    return(monitor_episodes(lines))
  }
  table <- utils::read.csv(text = lines, check.names = FALSE)
  if ("time/total_timesteps" %in% names(table)) {
    progress_curves(table, file)
  } else {
    cleanrl_curves(table, file)
  }
}

# Reads the columns of Stable-Baselines3's logger, which our log has, too.
progress_curves <- function(table, file) {
  evaluated <- any(!is.na(table[["eval/mean_reward"]]))
  value <- table[[if (evaluated) "eval/mean_reward" else "rollout/ep_rew_mean"]]
  rows <- data.frame(
    steps = table[["time/total_timesteps"]], mean_return = value %||% rep(NA_real_, nrow(table)),
    kind = rep(if (evaluated) "curve" else "training", nrow(table))
  )
  run_rows(dirname(file), rows)
}

# Stable-Baselines3's Monitor: a line of JSON, then reward, length and time of each episode. If a
# training was resumed, that line has the start of the first session, and the times of each session
# begin at 0.
monitor_episodes <- function(lines) {
  about <- jsonlite::fromJSON(sub("^#", "", lines[[1L]]))
  rows <- utils::read.csv(text = c(lines[-1L], if (length(lines) == 1L) "r,l,t"))
  rows <- list2DF(lapply(rows[c("r", "l", "t")], log_numbers))
  rows <- rows[stats::complete.cases(rows), ]
  rows$session <- cumsum(diff(c(-Inf, rows$t)) < 0)
  rows$time <- rows$t + about$t_start
  rows$env_id <- rep(about$env_id %||% NA_character_, nrow(rows))
  rows
}

has_episodes <- function(table) "session" %in% names(table)

# Each of the parallel environments has its own file. Episodes of a file stay in their order.
monitor_curves <- function(episodes, path) {
  episodes <- episodes[order(episodes$session, episodes$time), ]
  rows <- data.frame(
    steps = cumsum(as.numeric(episodes$l)), mean_return = episodes$r,
    kind = rep("training", nrow(episodes)), episodes = rep(1L, nrow(episodes))
  )
  run_rows(path, rows, env_id = episodes$env_id[1L])
}

# A table of TensorBoard has one run. A table of Weights & Biases has the columns of one run, or a
# column for each run, named after the run.
cleanrl_curves <- function(table, file) {
  if (all(c("Step", "Value") %in% names(table))) {
    return(run_rows(file, training_rows(table$Step, table$Value)))
  }
  columns <- grep("episodic_return$", names(table), value = TRUE)
  steps <- table[[intersect(c("global_step", "_step", "Step"), names(table))[1L]]]
  if (!length(columns) || is.null(steps)) {
    return(NULL)
  }
  do.call(rbind, lapply(columns, function(column) {
    run <- sub(" - [^ ]*episodic_return$", "", column)
    run_rows(
      if (run == column) file else run, training_rows(steps, table[[column]])
    )
  }))
}

training_rows <- function(steps, value) {
  data.frame(steps = steps, mean_return = value, kind = rep("training", length(steps)))
}

log_numbers <- function(x) {
  if (!is.numeric(x) && !all(is.na(x))) rlang::abort("A column of numbers has text.")
  as.numeric(x)
}

# Completes the columns of a run. A value that the log lacks is taken from the name of the run:
# CleanRL's names consist of environment, script, seed and time.
run_rows <- function(run, rows, env_id = NULL, seed = NULL) {
  name <- basename(run)
  pattern <- "^(run-)?(.+)__(.+)__([0-9]+)__[0-9]+.*$"
  if (grepl(pattern, name)) {
    env_id <- env_id %||% sub(pattern, "\\2", name)
    seed <- seed %||% sub(pattern, "\\4", name)
  }
  if (grepl("seed[-_=]?[0-9]", name)) {
    seed <- seed %||% sub(".*seed[-_=]?([0-9]+).*", "\\1", name)
  }
  rows[c("steps", "mean_return")] <- lapply(rows[c("steps", "mean_return")], log_numbers)
  # A row that logs other values lacks these two, and so does a line that a crash has cut off.
  rows <- rows[!is.na(rows$steps) & !is.na(rows$mean_return), ]
  missing <- setdiff(names(no_curve), names(rows))
  rows[missing] <- lapply(no_curve[missing], function(none) rep(none[NA_integer_], nrow(rows)))
  rows$env_id <- rep(env_id %||% NA_character_, nrow(rows))
  rows$seed <- rep(as.numeric(seed %||% NA), nrow(rows))
  # A table without rows has logical columns.
  rows <- if (nrow(rows)) rows[names(no_curve)] else no_curve
  cbind(rows, run = rep(run, nrow(rows)))
}
