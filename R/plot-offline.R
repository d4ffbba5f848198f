#' Plot estimates from data
#'
#' Show the estimate of each method with its interval, beside the mean return of the data (the
#' dashed line, with its interval as a band).
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [evaluate_offline()].
#' @param main The title. `NULL`, the default, says what is estimated.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_offline
#' @exportS3Method ggplot2::autoplot
#' @examples
#' set.seed(1)
#' steps <- data.frame(episode = 1:200, severity = runif(200), action = rep(0:1, 100))
#' steps$reward <- ifelse(steps$action == 1, steps$severity, 0.4) + rnorm(200, sd = 0.3)
#' plot(evaluate_offline(steps_data(steps), 1, behavior = policy_random(), seed = 1))
autoplot.gym_offline <- function(object, ...) {
  check_dots_empty(...)
  each <- object$estimates
  each$method <- factor(each$method, rev(each$method))
  known <- !is.na(object$observed$estimate)
  marks <- list(
    estimate = key_mark("blue", shape = 16),
    `the data's policy` = if (known) key_mark("ink", line = "dashed")
  )
  ggplot2::ggplot(each, ggplot2::aes(x = .data$estimate, y = .data$method)) +
    (if (known) {
      list(
        ggplot2::annotate(
          "rect", xmin = object$observed$lower, xmax = object$observed$upper, ymin = -Inf,
          ymax = Inf, fill = "grey90"
        ),
        ggplot2::geom_vline(
          ggplot2::aes(xintercept = .data$estimate, colour = "the data's policy"), object$observed,
          linetype = "dashed", linewidth = 0.7
        )
      )
    }) +
    ggplot2::geom_segment(
      ggplot2::aes(
        x = .data$lower, xend = .data$upper, yend = .data$method, colour = "estimate"
      ),
      linewidth = 0.7
    ) +
    ggplot2::geom_point(ggplot2::aes(colour = "estimate"), size = 2.5) +
    key_of_marks(marks) +
    picture_labels(
      if (is.null(object$folds)) "Value of the policy, by data" else "Mean value of the rules",
      paste0(level_text(object$level), " intervals, ", count_of(object$episodes, "episode"),
             if (!is.null(object$folds)) paste0(", ", object$folds, " folds")),
      x = if (object$discount < 1) "discounted return" else "return", y = NULL
    ) +
    theme_gym()
}
