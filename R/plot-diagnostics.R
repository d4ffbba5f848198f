# The numbers that an agent logs about its learning, which show why it does not learn: a panel for
# each number over the steps of the training.

diagnostics_picture <- function(x, call = rlang::caller_env()) {
  names <- names(agent_log(x$agent))
  if (!length(names)) {
    gym_abort(
      c(paste0("The training has no diagnostics: ", training_label(x), " logs none."),
        i = "`agent_ppo()` and other agents with a method of `agent_log()` do."),
      class = "gym_error_argument", argument = "type", value = "diagnostics", call = call
    )
  }
  rows <- do.call(rbind, lapply(names, function(name) {
    data.frame(steps = x$history$steps, name = name, value = x$history[[name]])
  }))
  rows$name <- factor(rows$name, names)
  # Random episodes, which only supplied the first moments of observations, taught nothing.
  rows <- rows[is.finite(rows$value), ]
  # A number that stays the same would lie on an axis from half below it to half above it, where
  # that of a small one seems to be 0.
  spread <- stats::ave(rows$value, as.character(rows$name), FUN = function(x) diff(range(x)))
  constant <- rows[spread == 0, ]
  ggplot2::ggplot(rows, ggplot2::aes(.data$steps, .data$value)) +
    ggplot2::geom_blank(ggplot2::aes(y = 0.5 * .data$value), constant) +
    ggplot2::geom_blank(ggplot2::aes(y = 1.5 * .data$value), constant) +
    ggplot2::geom_line(colour = gym_colours[["blue"]], linewidth = 0.6) +
    ggplot2::geom_point(colour = gym_colours[["blue"]], size = 0.6) +
    ggplot2::facet_wrap(ggplot2::vars(.data$name), scales = "free_y", ncol = 2L) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA), n.breaks = 4) +
    number_axis(
      ggplot2::scale_y_continuous, n.breaks = 4, guide = ggplot2::guide_axis(check.overlap = TRUE)
    ) +
    picture_labels(trainings_title(list(x)), x = training_steps_label, y = NULL) +
    theme_gym_panels()
}
