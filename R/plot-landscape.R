#' Plot a landscape
#'
#' Shows the mean return of the networks around the best policy of a search: the lighter
#' the higher, with lines of equal height. The cross in the middle is the best policy.
#' The line of the target is thick.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object What [search_landscape()] returned.
#' @param main The title; `NULL`, the default, names the environment.
#' @param xlab,ylab The axes' labels.
#' @param ... Further arguments of [plot()][graphics::plot.default()]; not used by
#'   `autoplot()`.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when no network was played to the end.
#' @export
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search_landscape(search, size = 5, episodes = 2, seed = 1))
plot.gym_landscape <- function(x, main = NULL, xlab = "first direction",
                               ylab = "second direction", ...) {
  data <- landscape_plot_data(x)
  open_plot(
    list(x = range(data$x), y = range(data$y), xlab = xlab, ylab = ylab, xaxs = "i", yaxs = "i"),
    list(...)
  )
  draw_field(data[c("x", "y", "z", "zlim", "palette")])
  draw_heights(data)
  graphics::points(0, 0, pch = 4L, lwd = 6, cex = 1.6, col = "white")
  graphics::points(0, 0, pch = 4L, lwd = 3, cex = 1.6)
  title_above(main %||% landscape_title(x))
  colour_key_above(data$key)
  invisible(x)
}

landscape_title <- function(x) paste0(x$env_id, ": around the best policy")

# plot() of a search with type = "landscape".
plot_landscape <- function(search, ..., main = NULL) {
  arguments <- list(...)
  own <- names(arguments) %in% names(formals(search_landscape))
  landscape <- do.call(search_landscape, c(list(search), arguments[own]))
  do.call(graphics::plot, c(list(landscape, main = main), arguments[!own]))
}

#' Compute what a plot of a landscape shows
#' @return A list: `x`, `y` (the places), `z` (a matrix, a row for each x), `zlim`,
#'   `palette`, `levels` (heights of the lines), `target` (`NULL` where no line of it can be
#'   drawn), `key` (the legend).
#' @noRd
landscape_plot_data <- function(x, call = rlang::caller_env()) {
  played <- x$grid$mean_return
  if (all(is.na(played))) {
    gym_abort(
      "There is nothing to plot: the landscape was interrupted before a network had played.",
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  steps <- unique(x$grid$a)
  zlim <- range(played, na.rm = TRUE)
  flat <- zlim[[1L]] == zlim[[2L]]
  inside <- function(level) level[level > zlim[[1L]] & level < zlim[[2L]]]
  palette <- grDevices::hcl.colors(101L, "viridis")
  list(
    x = steps, y = steps, z = matrix(played, length(steps)),
    zlim = if (flat) zlim + c(-1, 1) else zlim,
    palette = palette,
    levels = setdiff(inside(pretty(zlim, 5L)), x$target),
    target = if (length(inside(x$target))) x$target,
    key = list(palette = palette, ends = number_text_each(zlim), label = "mean return")
  )
}

# The lines are white, because colours are dark where mean returns are low.
draw_heights <- function(data) {
  if (length(data$levels)) {
    graphics::contour(data$x, data$y, data$z, levels = data$levels, add = TRUE, labcex = 0.7,
                      col = grDevices::adjustcolor("white", 0.8))
  }
  if (!is.null(data$target)) {
    graphics::contour(data$x, data$y, data$z, levels = data$target, add = TRUE, labcex = 0.8,
                      lwd = 2.5, labels = paste("target", number_text(data$target)))
  }
}

#' @rdname plot.gym_landscape
#' @exportS3Method ggplot2::autoplot
autoplot.gym_landscape <- function(object, ...) {
  data <- landscape_plot_data(object)
  heights <- function(levels, ...) {
    if (length(levels)) {
      ggplot2::geom_contour(ggplot2::aes(z = .data$mean_return), breaks = levels, na.rm = TRUE, ...)
    }
  }
  ggplot2::ggplot(object$grid, ggplot2::aes(.data$a, .data$b)) +
    ggplot2::geom_raster(ggplot2::aes(fill = .data$mean_return)) +
    ggplot2::scale_fill_gradientn(colours = data$palette, limits = data$zlim,
                                  name = "mean return") +
    heights(data$levels, colour = "white", alpha = 0.8) +
    heights(data$target, colour = "black", linewidth = 1.2) +
    ggplot2::annotate("point", 0, 0, shape = 4, size = 3, stroke = 2) +
    ggplot2::coord_cartesian(expand = FALSE) +
    ggplot2::labs(title = landscape_title(object), x = "first direction", y = "second direction")
}
