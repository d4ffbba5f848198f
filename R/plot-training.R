#' Plot a training
#'
#' Shows how a training went over the steps of the environment: the range of the candidates' returns
#' in each iteration as a band, their median as a line, the return of the agent's own policy, where
#' it was looked at, as points, and the target as a dashed line. The final evaluation is the filled
#' point at the end, with its interval.
#'
#' Several trainings that are given together are compared as [plot.gym_trainings()] draws them.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object A training, as [train_agent()] returns it. It may have another name, that of its
#'   line, as in `plot(ARS = first, CEM = second)`.
#' @param main The title; the default names the environment and the agent.
#' @param xlab,ylab The axes' labels.
#' @param ... Further trainings to compare, with the names of their lines or without; and further
#'   arguments of [plot()][graphics::plot.default()], such as `ylim`, which `autoplot()` does not
#'   take.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when no iteration was played to its end.
#' @export
#' @examplesIf gym:::can_start_server()
#' trained <- train_agent(agent_ars(), "CartPole-v1", iterations = 20, seed = 1)
#' plot(trained)
plot.gym_training <- function(x, ..., main = NULL, xlab = NULL, ylab = NULL) {
  given <- if (missing(x)) {
    given_trainings(list(...), substitute(list(...)))
  } else {
    given_trainings(list(x, ...), substitute(list(x, ...)))
  }
  if (length(given$trainings) > 1L) {
    draw_trainings(given, main, xlab, ylab)
  } else {
    draw_training(given$trainings[[1L]], main, xlab, ylab, given$others)
  }
  invisible(given$trainings[[1L]])
}

draw_training <- function(x, main, xlab, ylab, chosen) {
  data <- training_plot_data(x)
  open_plot(
    list(x = data$xlim, y = data$ylim, xlab = xlab %||% training_steps_label,
         ylab = ylab %||% returns_label),
    chosen
  )
  history <- data$history
  if (!is.null(data$target)) {
    graphics::abline(h = data$target, col = okabe_ito$vermillion, lty = "dashed", lwd = 2)
  }
  graphics::polygon(
    c(history$steps, rev(history$steps)), c(history$min_return, rev(history$max_return)),
    col = grDevices::adjustcolor(okabe_ito$sky_blue, 0.35), border = NA
  )
  graphics::lines(history$steps, history$median_return, col = okabe_ito$blue, lwd = 2)
  graphics::points(data$curve$steps, data$curve$mean_return, pch = 1L, col = okabe_ito$orange,
                   lwd = 2)
  final <- data$final
  if (!is.null(final)) {
    graphics::segments(final$steps, final$lower, final$steps, final$upper, lwd = 2,
                       col = okabe_ito$orange)
    graphics::points(final$steps, final$mean_return, pch = 16L, col = okabe_ito$orange, cex = 1.3)
  }
  title_above(main %||% trainings_title(list(x)))
  training_legend(data)
}

#' Compute what a plot of a training shows
#' @return A list: `history` (as the training's), `curve` (the evaluations but the final one, with
#'   the column `steps`), `final` (the final one, `NULL` for none), `target` (`NULL` for none),
#'   `xlim`, `ylim`.
#' @noRd
training_plot_data <- function(x, call = rlang::caller_env()) {
  history <- x$history
  if (!NROW(history)) {
    gym_abort(
      "There is nothing to plot: the training ended before its first iteration did.",
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  evaluations <- x$evaluations
  evaluations$steps <- history$steps[evaluations$iteration]
  final <- evaluations[evaluations$kind == "final", ]
  target <- if (!is.null(x$target) && is.finite(x$target)) x$target
  list(
    history = history, curve = evaluations[evaluations$kind != "final", ],
    final = if (NROW(final)) final[nrow(final), ], target = target,
    xlim = c(0, max(history$steps)),
    ylim = range(history$min_return, history$max_return, evaluations$mean_return,
                 final[c("lower", "upper")], target, na.rm = TRUE)
  )
}

training_legend <- function(data) {
  shown <- c(TRUE, TRUE, NROW(data$curve) > 0L || !is.null(data$final), !is.null(data$target))
  legend_above(
    labels = c("candidates", "their median", "the policy",
               paste("target", number_text(data$target)))[shown],
    col = c(okabe_ito$sky_blue, okabe_ito$blue, okabe_ito$orange, okabe_ito$vermillion)[shown],
    pch = c(15L, NA, 1L, NA)[shown],
    lty = c(NA, "solid", NA, "dashed")[shown]
  )
}

# Drawn with ggplot2. It is registered when that is loaded, see autoplot.gym_rollout().
#' @rdname plot.gym_training
#' @exportS3Method ggplot2::autoplot
autoplot.gym_training <- function(object, ...) {
  given <- if (missing(object)) {
    given_trainings(list(...), substitute(list(...)))
  } else {
    given_trainings(list(object, ...), substitute(list(object, ...)))
  }
  rlang::exec(check_dots_empty, !!!given$others)
  if (length(given$trainings) > 1L) {
    autoplot_trainings(given$trainings)
  } else {
    autoplot_training(given$trainings[[1L]])
  }
}

autoplot_training <- function(object) {
  data <- training_plot_data(object)
  steps <- ggplot2::aes(x = .data$steps)
  plot <- ggplot2::ggplot(data$history, steps) +
    ggplot2::geom_ribbon(ggplot2::aes(ymin = .data$min_return, ymax = .data$max_return),
                         fill = okabe_ito$sky_blue, alpha = 0.35) +
    ggplot2::geom_line(ggplot2::aes(y = .data$median_return), colour = okabe_ito$blue,
                       linewidth = 0.8) +
    ggplot2::geom_point(ggplot2::aes(y = .data$mean_return), data$curve, shape = 1,
                        colour = okabe_ito$orange, size = 2) +
    ggplot2::geom_pointrange(
      ggplot2::aes(y = .data$mean_return, ymin = .data$lower, ymax = .data$upper),
      data$final %||% data$curve[0L, ], colour = okabe_ito$orange
    ) +
    ggplot2::labs(
      title = trainings_title(list(object)), x = training_steps_label, y = returns_label,
      subtitle = paste("band: candidates; line: their median; points: the policy, filled at the",
                       "end; dashed: target")
    )
  if (is.null(data$target)) {
    plot
  } else {
    plot + ggplot2::geom_hline(yintercept = data$target, colour = okabe_ito$vermillion,
                               linetype = "dashed", linewidth = 0.8)
  }
}
