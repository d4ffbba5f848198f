#' @param object A sweep.
#' @rdname sweep_agent
#' @exportS3Method ggplot2::autoplot
autoplot.gym_sweep <- function(object, ...) {
  check_dots_empty(...)
  trained <- Filter(Negate(is.null), object$trainings)
  target <- common_target(trained)
  picture <- trainings_picture(trained)
  # The panels' titles replace the key, which would name the target.
  dashed <- if (!is.null(target)) paste("dashed line:", target_label(target))
  picture +
    ggplot2::labs(subtitle = paste(c(picture$labels$subtitle, dashed), collapse = "\n")) +
    ggplot2::facet_wrap(ggplot2::vars(.data$label), ncol = 2L, labeller = wrapped_strips()) +
    theme_gym_panels() +
    ggplot2::theme(legend.position = "none")
}
