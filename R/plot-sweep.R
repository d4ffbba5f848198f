#' @param object A sweep.
#' @rdname sweep_agent
#' @exportS3Method ggplot2::autoplot
autoplot.gym_sweep <- function(object, ...) {
  check_dots_empty(...)
  trained <- Filter(Negate(is.null), object$trainings)
  trainings_picture(trained) +
    ggplot2::facet_wrap(ggplot2::vars(.data$label), ncol = 2L, labeller = wrapped_strips()) +
    theme_gym_panels() +
    ggplot2::theme(legend.position = "none")
}
