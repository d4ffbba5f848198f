#' Plot how bandits were learned
#'
#' Shows the mean reward of all learners, or how many of them took the best arm, step by step.
#' Several given together are compared in one picture.
#'
#' @param x,object What [learn_bandit()] returned.
#' @param ... More of them, which may have names for the legend.
#' @param what What is shown, a string: `"mean_reward"`, the default, or `"best_share"`.
#' @param main The title; `NULL`, the default, names the bandit.
#' @return The first of them, invisibly; `autoplot()` a ggplot.
#' @export
#' @examples
#' testbed <- bandit(arms = 10, horizon = 200)
#' few <- learn_bandit(testbed, epsilon = 0.01, learners = 200, seed = 1)
#' many <- learn_bandit(testbed, epsilon = 0.1, learners = 200, seed = 1)
#' plot(few, many, what = "best_share")
plot.gym_bandit_learning <- function(x, ..., what = c("mean_reward", "best_share"), main = NULL) {
  # All of them may be named.
  runs <- if (missing(x)) list(...) else list(x, ...)
  data <- bandit_plot_data(runs, what)
  open_plot(
    list(x = range(data$curves$step), y = data$range, xlab = "step", ylab = data$label), list()
  )
  colours <- bandit_colours(data)
  for (name in levels(data$curves$learner)) {
    own <- data$curves[data$curves$learner == name, ]
    graphics::lines(own$step, own$value, col = colours[[name]])
  }
  title_above(main %||% data$title)
  each <- rep(1L, length(colours))
  legend_above(names(colours), col = unname(colours), pch = NA, lty = each)
  invisible(runs[[1L]])
}

bandit_colours <- function(data) {
  names <- levels(data$curves$learner)
  stats::setNames(rep_len(line_colours, length(names)), names)
}

bandit_plot_data <- function(runs, what, call = rlang::caller_env()) {
  what <- check_choice(what[1L], c("mean_reward", "best_share"), arg = "what", call = call)
  for (i in seq_along(runs)) {
    if (!inherits(runs[[i]], "gym_bandit_learning")) {
      abort_argument(runs[[i]], "what `learn_bandit()` returns", paste0("..", i), call)
    }
  }
  labels <- vapply(runs, function(run) run$label, "")
  given <- names(runs) %||% rep("", length(runs))
  labels <- make.unique(ifelse(nzchar(given), given, labels), sep = ", again ")
  curves <- do.call(rbind, Map(function(run, label) {
    data.frame(step = run$curve$step, value = run$curve[[what]], learner = label)
  }, runs, labels))
  curves$learner <- factor(curves$learner, unname(labels))
  list(
    curves = curves, title = runs[[1L]]$env_id,
    range = if (what == "best_share") c(0, 1) else range(curves$value),
    label = if (what == "best_share") "share that takes the best arm" else "mean reward"
  )
}

#' @rdname plot.gym_bandit_learning
#' @exportS3Method ggplot2::autoplot
autoplot.gym_bandit_learning <- function(object, ..., what = c("mean_reward", "best_share")) {
  data <- bandit_plot_data(list(object, ...), what)
  ggplot2::ggplot(
    data$curves, ggplot2::aes(x = .data$step, y = .data$value, colour = .data$learner)
  ) +
    ggplot2::geom_line() +
    ggplot2::scale_colour_manual(values = bandit_colours(data)) +
    ggplot2::coord_cartesian(ylim = data$range) +
    ggplot2::labs(y = data$label, colour = NULL, title = data$title)
}
