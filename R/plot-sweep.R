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
  titles <- varied_settings(names(trained))
  picture +
    ggplot2::labs(
      subtitle = paste(
        broken_texts(c(picture$labels$subtitle, titles$constant, dashed), 54), collapse = "\n"
      )
    ) +
    ggplot2::facet_wrap(
      ggplot2::vars(.data$label), ncol = 2L, labeller = ggplot2::as_labeller(function(labels) {
        broken_texts(titles$each[labels], 33)
      })
    ) +
    theme_gym_panels() +
    ggplot2::theme(legend.position = "none")
}

# Splits the names of settings, such as "step_size = 0.1, noise = 0.05", into what they share and
# the rest, which the panels' titles need not repeat.
varied_settings <- function(names) {
  parts <- strsplit(names, ", ", fixed = TRUE)
  shared <- if (length(names) > 1L) Reduce(intersect, parts)
  each <- vapply(parts, function(part) paste(setdiff(part, shared), collapse = ", "), "")
  list(
    constant = if (length(shared)) paste(shared, collapse = ", "),
    each = stats::setNames(ifelse(nzchar(each), each, names), names)
  )
}
