#' Combine learning curves in one table
#'
#' Collect the evaluations of all trainings and seeds, from results and from log files.
#'
#' Files may come from other programs:
#'
#' * a folder with a log of this package (`train_agent(log = )`), or with one below it for each
#'   seed;
#' * a folder of Stable-Baselines3 with `progress.csv` (from its logger): the evaluations
#'   (`eval/mean_reward`), or without them the episodes of `monitor.csv` files (from its Monitor, or
#'   `0.monitor.csv` and so on, ordered by time), or otherwise `rollout/ep_rew_mean`; or such a file
#'   itself;
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
#'   evaluation it has `NA`. Their `kind` is `"interpolated"`.
#' @return A data frame with a row for each evaluation: `training`, `env_id` (strings, `NA` if the
#'   log does not have it), `seed` (a whole number; for other programs the one in a name such as
#'   `seed-3` or CleanRL's `CartPole-v1__ppo__3__1700000000`, otherwise the run's number),
#'   `iteration` (integer, 0 before the first, `NA` in logs of others), `steps` of the training,
#'   `mean_return` (doubles), `kind` (`"curve"`, `"stopping"`, `"final"` or `"training"`), `se`,
#'   `lower`, `upper` (its standard error and 95% interval, doubles, `NA` if unknown) and `episodes`
#'   (integer).
#' @section Errors: `gym_error_argument` for an object that is neither a training nor a log, for a
#'   damaged log, and for the result of [search_random()], which has no evaluations. Damaged logs
#'   beside others are left out with a warning, `gym_warning_log`.
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
  given <- with_settings(name_results(list(...), as.list(substitute(list(...)))[-1L]))
  rows <- Map(function(x, label) {
    rows <- curve_rows(x, label, call)
    cbind(training = rep(label, nrow(rows)), rows)
  }, given, names(given))
  table <- do.call(rbind, c(list(cbind(training = character(), no_curve)), unname(rows)))
  if (!is.null(at)) table <- curves_at(table, at)
  row.names(table) <- NULL
  table
}

# All runs at the same numbers of steps.
curves_at <- function(table, at) {
  run <- paste(table$training, table$env_id, table$seed, sep = "\r")
  each <- lapply(split(table, factor(run, unique(run))), function(own) {
    return <- returns_at(own, at)
    return[at < min(own$steps)] <- NA
    of_one <- no_curve[rep(NA_integer_, length(at)), ]
    of_one[c("env_id", "seed")] <- own[1L, c("env_id", "seed")]
    of_one[c("steps", "kind", "mean_return")] <- list(as.numeric(at), "interpolated", return)
    cbind(training = rep(own$training[[1L]], length(at)), of_one)
  })
  do.call(rbind, c(list(table[0L, ]), unname(each)))
}

# Between two evaluations the return is interpolated, beyond them the nearest counts. Of several at
# one place the last counts, which had the most episodes.
returns_at <- function(curve, at) {
  curve <- curve[!duplicated(curve$steps, fromLast = TRUE), ]
  if (nrow(curve) == 1L) {
    rep(curve$mean_return, length(at))
  } else {
    stats::approx(curve$steps, curve$mean_return, at, rule = 2L)$y
  }
}

# Each setting of a sweep is a training with its own name.
with_settings <- function(given) {
  do.call(c, unname(Map(function(x, label) {
    own <- if (inherits(x, "gym_sweep")) x$trainings else stats::setNames(list(x), label)
    Filter(Negate(is.null), own)
  }, given, names(given))))
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
    read_curves(x, call)
  } else {
    must <- "a training, or the folder or file of a log, a string"
    abort_argument(x, must, if (nzchar(label)) label else "...", call)
  }
}
