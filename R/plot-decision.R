#' Plot a decision map
#'
#' Shows what a policy does over two parts of the observation: by colour the output of a
#' network that is rounded to one of two actions, with a line where it is one half; the
#' action that is taken; or the value of an action that is a Box, with a line at the middle
#' of its bounds. Regions have the names of their actions. The path of an episode begins at
#' the ring and ends at the cross.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object What [decision_map()] returned.
#' @param main The title; `NULL`, the default, names the environment and the policy.
#' @param xlab,ylab The axes' labels; the default are the names of the parts, with their units
#'   where Gymnasium's documentation has them.
#' @param ... Further arguments of [plot()][graphics::plot.default()]; not used by
#'   `autoplot()`.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @export
#' @examples
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 0.3), nrow = 1)))
#' plot(decision_map(policy = follow, x = 3, y = 4, xlim = c(-0.2, 0.2), ylim = c(-3, 3)))
plot.gym_decision_map <- function(x, main = NULL, xlab = decision_label(x, x$x),
                                  ylab = decision_label(x, x$y), ...) {
  data <- decision_plot_data(x)
  open_plot(
    list(x = range(data$x), y = range(data$y), xlab = xlab, ylab = ylab, xaxs = "i", yaxs = "i"),
    list(...)
  )
  draw_field(data)
  draw_regions(data$regions)
  draw_path(data$path)
  graphics::box(bty = "l")
  title_above(main %||% played_title(x))
  if (is.null(data$key$labels)) {
    colour_key_above(data$key)
  } else {
    legend_above(data$key$labels, col = data$key$palette, pch = 15L, lty = NA)
  }
  invisible(x)
}

decision_label <- function(x, name) observation_labels(x$env_id, name)

# Data ----------------------------------------------------------------------------

#' Compute what a plot of a decision map shows
#' @return A list: `x`, `y` (the grid's places), `z` (a matrix, a row for each x),
#'   `zlim`, `palette`, `border` (the level of the line between, `NULL` where there is none),
#'   `regions` (data frame: `x`, `y`, `label`, `colour`), `path`, `key` (the legend).
#' @noRd
decision_plot_data <- function(x) {
  shown <- x$grid[[3L]]
  data <- list(x = unique(x$grid[[1L]]), y = unique(x$grid[[2L]]))
  data$z <- matrix(as.numeric(shown), length(data$x), length(data$y))
  data <- c(data, switch(x$kind,
    output = output_colours(x, data),
    choice = choice_colours(x, data),
    value = value_colours(x, data)
  ))
  data$path <- x$path
  data
}

# The colours reach as far from one half as the outputs do, because small weights make small
# differences.
output_colours <- function(x, data) {
  palette <- diverging_colours()
  reach <- max(abs(data$z - 0.5), 0.01)
  zlim <- 0.5 + c(-reach, reach)
  list(
    zlim = zlim, palette = palette, border = 0.5,
    regions = region_labels(data, 1 + (data$z > 0.5), x$actions),
    key = list(palette = palette, ends = sprintf("%.2f", zlim), label = "output")
  )
}

value_colours <- function(x, data) {
  palette <- diverging_colours()
  limits <- x$limits %||% range(data$z)
  # One colour where there is only one value.
  zlim <- if (diff(limits) > 0) limits else limits + c(-1, 1)
  list(
    zlim = zlim, palette = palette, border = mean(zlim), regions = NULL,
    key = list(palette = palette, ends = number_text_each(zlim), label = x$actions)
  )
}

choice_colours <- function(x, data) {
  n <- length(x$actions)
  start <- as.integer(sub(":.*", "", x$actions[[1L]]))
  palette <- choice_palette(n)
  taken <- sort(unique(as.vector(data$z))) - start + 1
  list(
    zlim = start + c(-0.5, n - 0.5), palette = palette, border = NULL,
    regions = region_labels(data, data$z - start + 1, x$actions),
    key = list(palette = palette[taken], labels = x$actions[taken])
  )
}

# Orange and blue, light enough for black text on them; they differ in lightness, too.
diverging_colours <- function() {
  grDevices::colorRampPalette(c("#EFB549", "#FAF7F0", "#4797C8"))(101L)
}

# Lighter than the colours of lines, so that names and paths can be read on them.
choice_palette <- function(n) {
  strong <- c(okabe_ito$orange, okabe_ito$sky_blue, okabe_ito$green, okabe_ito$purple,
              okabe_ito$yellow, okabe_ito$vermillion, okabe_ito$blue)
  if (n > length(strong)) {
    return(grDevices::hcl.colors(n, "viridis"))
  }
  tint <- c(0.35, 0.75, 0.8, 0.7, 0.8, 0.7, 0.7)[seq_len(n)]
  mixed <- grDevices::col2rgb(strong[seq_len(n)]) %*% diag(tint, n) +
    matrix(255 * (1 - tint), 3L, n, byrow = TRUE)
  grDevices::rgb(t(mixed), maxColorValue = 255)
}

#' Find where the names of regions stand
#'
#' The name stands at the point of the region that is farthest from others, where there
#' is room for it.
#' @param region A matrix of numbers from 1, as `data$z`.
#' @noRd
region_labels <- function(data, region, labels) {
  found <- sort(unique(as.vector(region)))
  places <- lapply(found, function(i) region_middle(region == i))
  share <- vapply(found, function(i) mean(region == i), 0)
  at <- do.call(rbind, places)[share > 0.02, , drop = FALSE]
  data.frame(x = data$x[at[, 1L]], y = data$y[at[, 2L]], label = labels[found[share > 0.02]])
}

# Points at the border are removed again and again, until none is left: those that are removed last
# lie in the middle.
region_middle <- function(inside) {
  repeat {
    n <- nrow(inside)
    m <- ncol(inside)
    core <- inside &
      rbind(FALSE, inside[-n, , drop = FALSE]) & rbind(inside[-1L, , drop = FALSE], FALSE) &
      cbind(FALSE, inside[, -m, drop = FALSE]) & cbind(inside[, -1L, drop = FALSE], FALSE)
    if (!any(core)) {
      break
    }
    inside <- core
  }
  left <- which(inside, arr.ind = TRUE)
  middle <- colMeans(left)
  left[which.min(colSums((t(left) - middle)^2)), ]
}

# Drawing -------------------------------------------------------------------------

draw_regions <- function(regions) {
  if (NROW(regions)) {
    graphics::text(regions$x, regions$y, regions$label, font = 2L)
  }
}

draw_path <- function(path) {
  if (is.null(path)) {
    return(invisible())
  }
  for (episode in split(path, path$episode)) {
    last <- nrow(episode)
    graphics::lines(episode$x, episode$y, col = "white", lwd = 2.5)
    graphics::lines(episode$x, episode$y)
    graphics::points(episode$x[[1L]], episode$y[[1L]], pch = 21L, bg = "white", lwd = 2, cex = 1.4)
    graphics::points(episode$x[[last]], episode$y[[last]], pch = 4L, lwd = 3, cex = 1.4)
  }
}

# With ggplot2 -----------------------------------------------------------------------

#' @rdname plot.gym_decision_map
#' @exportS3Method ggplot2::autoplot
autoplot.gym_decision_map <- function(object, ...) {
  data <- decision_plot_data(object)
  points <- expand.grid(x = data$x, y = data$y)
  points$z <- as.vector(data$z)
  ends <- function(path, last) {
    do.call(rbind, lapply(split(path, path$episode), function(episode) {
      episode[if (last) nrow(episode) else 1L, ]
    }))
  }
  fill <- if (is.null(data$key$labels)) {
    ggplot2::scale_fill_gradientn(colours = data$palette, limits = data$zlim,
                                  name = data$key$label)
  } else {
    points$z <- factor(points$z, labels = data$key$labels)
    ggplot2::scale_fill_manual(values = data$key$palette, name = "action")
  }
  plot <- ggplot2::ggplot(points, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_raster(ggplot2::aes(fill = .data$z)) +
    fill +
    ggplot2::labs(title = played_title(object), x = decision_label(object, object$x),
                  y = decision_label(object, object$y)) +
    ggplot2::coord_cartesian(expand = FALSE)
  if (length(data$border)) {
    plot <- plot + ggplot2::geom_contour(ggplot2::aes(z = .data$z), breaks = data$border,
                                         colour = "black", linewidth = 1)
  }
  if (NROW(data$regions)) {
    plot <- plot + ggplot2::geom_text(ggplot2::aes(label = .data$label), data$regions,
                                      fontface = "bold")
  }
  if (!is.null(data$path)) {
    path <- data$path
    plot <- plot +
      ggplot2::geom_path(ggplot2::aes(group = .data$episode), path, colour = "white",
                         linewidth = 1.8) +
      ggplot2::geom_path(ggplot2::aes(group = .data$episode), path, linewidth = 0.7) +
      ggplot2::geom_point(data = ends(path, FALSE), shape = 21, fill = "white", size = 3) +
      ggplot2::geom_point(data = ends(path, TRUE), shape = 4, stroke = 1.5, size = 2)
  }
  plot
}
