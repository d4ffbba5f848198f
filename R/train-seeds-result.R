#' Trainings with several seeds
#'
#' One training says little about an agent: another seed may fail. `train_agent(seeds = )` trains
#' once with each of many seeds and returns all trainings, failures included.
#'
#' A training has `reached` the target if its final evaluation has, which plays episodes that no
#' training has seen. The interval of this share is Wilson's, which also works if all or none have
#' reached it. A training has `stopped_early` if an evaluation during training reached the target.
#' At that time the policy was also lucky, so its final evaluation may miss the target. A training
#' that used up its budget may have reached it.
#'
#' @param x,object Trainings, as returned by `train_agent(seeds = )`.
#' @param row.names,optional,... Not used.
#' @return An object of class `gym_trainings`, a list with the elements
#'   \describe{
#'     \item{trainings}{A list of the trainings, objects of class `gym_training`, named by their
#'       seeds.}
#'     \item{agent, env_id, target}{The agent as given, the environment's id, a string, and the
#'       target, a number or `NULL`.}
#'     \item{elapsed}{The total time in seconds, a double.}
#'     \item{interrupted}{Whether it was interrupted, a logical. The last training may then have
#'       ended early.}
#'     \item{provenance}{The result of [provenance()], with all seeds.}
#'   }
#'   `as.data.frame()` returns a row for each seed: `seed` (whole number), `stopped_early`
#'   (logical), `iterations` (integer), `steps` (double), `mean_return`, `se`, `lower`, `upper` (of
#'   the final evaluation, doubles), `reached` (logical: has this mean return, or a round of a
#'   search, reached the target? `NA` without a target, and with `target = Inf`), `elapsed`
#'   (seconds, a double), `interrupted` (logical).
#'
#'   `coef()` returns the weights of the policies, a matrix with a row for each seed.
#' @references E. B. Wilson (1927), Probable inference, the law of succession, and statistical
#'   inference, Journal of the American Statistical Association 22, 209-212.
#' @seealso [train_agent()], [plot()][plot.gym_trainings()]
#' @name gym_trainings
#' @examplesIf gym:::can_start_server()
#' trained <- train_agent(agent_ars(), "CartPole-v1", iterations = 20, seeds = 1:3)
#' trained
#' as.data.frame(trained)
#' trained$trainings[["2"]]
NULL

new_trainings <- function(trainings, settings, elapsed, interrupted) {
  first <- if (length(trainings)) trainings[[1L]]
  origin <- first$provenance
  origin$seed <- vapply(trainings, function(training) as.numeric(training$seed), 0)
  structure(
    list(
      trainings = stats::setNames(trainings, format(origin$seed, scientific = FALSE, trim = TRUE)),
      agent = settings$agent, env_id = first$env_id, target = first$target, elapsed = elapsed,
      interrupted = interrupted, provenance = if (!is.null(first)) origin
    ),
    class = "gym_trainings"
  )
}

#' @rdname gym_trainings
#' @export
as.data.frame.gym_trainings <- function(x, row.names = NULL, optional = FALSE, ...) {
  check_no_curve(...)
  final <- function(training, name) as.numeric(training$final[[name]] %||% NA_real_)
  column <- function(f, type) unname(vapply(x$trainings, f, type))
  of_final <- function(name) column(function(training) final(training, name), 0)
  data.frame(
    seed = narrow_whole(column(function(training) as.numeric(training$seed), 0)),
    stopped_early = column(function(training) training$stopped_early, NA),
    iterations = column(function(training) NROW(training$history), 0L),
    steps = column(function(training) training$steps, 0),
    mean_return = of_final("mean_return"), se = of_final("se"), lower = of_final("lower"),
    upper = of_final("upper"), reached = column(function(training) training$solved, NA),
    elapsed = column(function(training) training$elapsed, 0),
    interrupted = column(function(training) training$interrupted, NA)
  )
}

#' @rdname gym_trainings
#' @export
coef.gym_trainings <- function(object, ...) {
  check_dots_empty(...)
  do.call(rbind, lapply(object$trainings, function(training) stats::coef(training$policy)))
}

#' @rdname gym_trainings
#' @export
summary.gym_trainings <- function(object, ...) object

#' Compute Wilson's score interval of a share
#' @noRd
wilson_interval <- function(successes, n, level = 0.95) {
  if (n == 0 || is.na(successes)) {
    return(c(NA_real_, NA_real_))
  }
  z <- stats::qnorm((1 + level) / 2)
  share <- successes / n
  middle <- (share + z^2 / (2 * n)) / (1 + z^2 / n)
  half <- z / (1 + z^2 / n) * sqrt(share * (1 - share) / n + z^2 / (4 * n^2))
  # At 0 and 1 rounding would leave the bound slightly off.
  c(if (successes == 0) 0 else middle - half, if (successes == n) 1 else middle + half)
}

#' @export
print.gym_trainings <- function(x, ...) {
  cat(trainings_lines(x), sep = "\n")
  invisible(x)
}

trainings_lines <- function(x) {
  table <- as.data.frame(x)
  if (!nrow(table)) {
    return("Ended before the first training was finished")
  }
  done <- table[!table$interrupted, ]
  returns <- done$mean_return[!is.na(done$mean_return)]
  c(
    paste0("Training in ", env_text(x), " by ", format(x$agent)),
    paste0("Policy: ", policy_text(x$trainings[[1L]]$policy)),
    if (nrow(done) && has_target(x)) {
      interval <- wilson_interval(sum(done$reached), nrow(done))
      c(
        paste0("Reached the target ", number_text(x$target), " with ", sum(done$reached), " of ",
               count_of(nrow(done), "seed"), " (",
               interval_text(interval[[1L]], interval[[2L]], text = percent_text), ")"),
        paste0("Stopped early: ", sum(done$stopped_early), " of ", nrow(done))
      )
    },
    if (length(returns)) {
      paste0("Final mean returns: median ", number_text(stats::median(returns)), ", from ",
             number_text(min(returns)), " to ", number_text(max(returns)))
    },
    paste0(if (any(table$interrupted)) "Interrupted after " else "Played ",
           count_of(nrow(done), "seed"), ", ", count_of(sum(table$steps), "step"),
           elapsed_text(x$elapsed))
  )
}
