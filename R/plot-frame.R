#' Show a frame
#'
#' Draw a frame as large as possible without distorting it.
#'
#' `autoplot()` returns a ggplot. `plot()` also prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A frame, from [env_render()].
#' @param main The title. `NULL`, the default, for none.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_frame
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' env$reset()
#' plot(env$render())
#' env$close()
autoplot.gym_frame <- function(object, ...) {
  check_dots_empty(...)
  # A picture without axes.
  ggplot2::ggplot(data.frame(x = 0:1, y = 0:1), ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_blank() +
    ggplot2::annotation_custom(grid::rasterGrob(as.raster(object))) +
    theme_gym_bare() +
    ggplot2::theme(plot.margin = ggplot2::margin(2, 2, 2, 2))
}
