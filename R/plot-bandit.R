#' Plot what bandit learners achieved
#'
#' Show the mean reward of all learners, or the share that took the best arm, at each step. Several
#' results are compared in one picture.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [learn_bandit()].
#' @param ... Further results, optionally with names for the key. `plot()` passes its arguments to
#'   `autoplot()`.
#' @param what What to show, a string: `"mean_reward"`, the default, or `"best_share"`.
#' @param main The title. `NULL`, the default, names the bandit.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_bandit_learning
#' @exportS3Method ggplot2::autoplot
#' @examples
#' testbed <- bandit(arms = 10, horizon = 200)
#' few <- learn_bandit(testbed, epsilon = 0.01, learners = 200, seed = 1)
#' many <- learn_bandit(testbed, epsilon = 0.1, learners = 200, seed = 1)
#' plot(few, many, what = "best_share")
autoplot.gym_bandit_learning <- function(object, ..., what = c("mean_reward", "best_share")) {
  # All of them may be named.
  runs <- if (missing(object)) list(...) else list(object, ...)
  what <- check_choice(what[1L], c("mean_reward", "best_share"), arg = "what")
  curves <- bandit_curves(runs, what)
  share <- what == "best_share"
  ggplot2::ggplot(curves, ggplot2::aes(.data$step, .data$value, colour = .data$learner)) +
    ggplot2::geom_line(linewidth = 0.5) +
    ggplot2::scale_colour_manual(
      name = NULL, values = named_colours(levels(curves$learner)),
      guide = rows_of_key(levels(curves$learner), override.aes = list(linewidth = 1))
    ) +
    number_axis(ggplot2::scale_x_continuous) +
    ggplot2::scale_y_continuous(limits = if (share) c(0, 1)) +
    picture_labels(
      runs[[1L]]$env_id, x = "step",
      y = if (share) "share that takes the best arm" else "mean reward"
    ) +
    theme_gym()
}

bandit_curves <- function(runs, what, call = rlang::caller_env()) {
  for (i in seq_along(runs)) {
    if (!inherits(runs[[i]], "gym_bandit_learning")) {
      abort_argument(runs[[i]], "what `learn_bandit()` returns", paste0("..", i), call)
    }
  }
  given <- rlang::names2(runs)
  labels <- vapply(runs, function(run) run$label, "")
  labels <- make.unique(ifelse(nzchar(given), given, labels), sep = ", again ")
  curves <- do.call(rbind, Map(function(run, label) {
    data.frame(step = run$curve$step, value = run$curve[[what]], learner = label, row.names = NULL)
  }, runs, labels))
  curves$learner <- factor(curves$learner, unname(labels))
  curves
}
