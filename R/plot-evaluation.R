#' Plot evaluations of policies
#'
#' Show the mean return of each policy as a dot with its confidence interval. Of more than ten
#' policies, the ten with the highest mean returns are shown.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [evaluate_policy()].
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if columns of the evaluation were removed.
#' @rdname plot.gym_evaluation
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' follow_pole <- function(observation) as.integer(observation[, 3] > 0)
#' policies <- list(random = policy_random(), follow = follow_pole)
#' plot(evaluate_policy("CartPole-v1", policies, episodes = 50, seed = 1))
autoplot.gym_evaluation <- function(object, ...) {
  check_dots_empty(...)
  missing <- setdiff(evaluation_columns, names(object))
  if (length(missing)) {
    must <- paste0("an evaluation with its column `", missing[[1L]], "`")
    abort_argument(object, must, "object", rlang::current_env())
  }
  few <- nrow(object) <= most_rows
  shown <- if (few) seq_len(nrow(object)) else order(-object$mean_return)[seq_len(most_rows)]
  rows <- as.data.frame(as.list(object)[evaluation_columns])[shown, ]
  rows$label <- factor(row.names(object)[shown], rev(row.names(object)[shown]))
  ggplot2::ggplot(rows, ggplot2::aes(.data$mean_return, .data$label)) +
    # A single episode has no interval.
    ggplot2::geom_linerange(
      ggplot2::aes(xmin = .data$lower, xmax = .data$upper), colour = gym_colours[["blue"]],
      linewidth = 0.8, na.rm = TRUE
    ) +
    ggplot2::geom_point(colour = gym_colours[["blue"]], size = 2.5) +
    number_axis(ggplot2::scale_x_continuous) +
    picture_labels(
      env_text(attributes(object)),
      c(
        if (!few) {
          paste("the", most_rows, "of", nrow(object), "policies with the highest mean returns")
        },
        paste("bar:", level_text(attr(object, "level") %||% 0.95), "interval"),
        episodes_each(rows$episodes)
      ),
      x = "mean return", y = NULL
    ) +
    theme_gym()
}
