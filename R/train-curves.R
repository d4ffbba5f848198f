#' Put learning curves together in one table
#'
#' Takes the evaluations of all trainings and seeds, from results and from logs in files.
#'
#' Files may be those of other programs:
#'
#' * a folder with a log of ours (`train_agent(log = )`), or with one below it for each seed;
#' * a folder of Stable-Baselines3's with `progress.csv` (its logger's), of which the evaluations
#'   (`eval/mean_reward`) are taken, and where there are none the episodes of `monitor.csv` files
#'   (its Monitor's, or those of `0.monitor.csv` and so on, one after the other by their time), and
#'   else `rollout/ep_rew_mean`; or such a file by itself;
#' * CSV files of CleanRL's `charts/episodic_return`: as Weights & Biases exports them (a column for
#'   each run, or the history of one), or TensorBoard (`Wall time`, `Step`, `Value`); or a folder of
#'   them.
#'
#' What these programs log of their training is no evaluation: actions are drawn, and often mean
#' returns of the last 100 episodes. Its `kind` is `"training"`.
#'
#' @param ... Trainings of class `gym_training` or [gym_trainings], and folders or files, strings.
#'   The name of an argument is that of its `training`; without one it is the variable's, the
#'   file's, or the agent's.
#' @return A data frame with a row for each evaluation: `training`, `env_id` (strings, `NA` where a
#'   log does not tell), `seed` (a whole number; of other programs the one that a name such as
#'   `seed-3` or CleanRL's `CartPole-v1__ppo__3__1700000000` has, else the run's number),
#'   `iteration` (integer, 0 before the first, `NA` in logs of others), `steps` of the training,
#'   `mean_return` (doubles), `kind` (`"curve"`, `"stopping"`, `"final"` or `"training"`), `se`,
#'   `lower`, `upper` (its standard error and 95% interval, doubles, `NA` where unknown) and
#'   `episodes` (integer).
#' @section Errors: `gym_error_argument` for what is neither a training nor a log, and for a search
#'   by the tutorial's rule, which has no evaluations.
#' @seealso [compare_trainings()], and [plot()][plot.gym_trainings()] for a picture.
#' @export
#' @examplesIf gym:::can_start_server()
#' ars <- train_agent(agent_ars(), "CartPole-v1", iterations = 10, eval_every = 5, seeds = 1:2)
#' learning_curves(ars)
learning_curves <- function(...) {
  call <- rlang::current_env()
  given <- name_results(list(...), as.list(substitute(list(...)))[-1L])
  rows <- Map(function(x, label) {
    rows <- curve_rows(x, label, call)
    cbind(training = rep(label, nrow(rows)), rows)
  }, given, names(given))
  table <- do.call(rbind, c(list(cbind(training = character(), no_curve)), unname(rows)))
  row.names(table) <- NULL
  table
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
      env_id = rep(x$env_id, nrow(x$evaluations)), seed = as.numeric(x$seed), x$evaluations
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
