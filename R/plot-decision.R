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
#' @param main The title; `NULL`, the default, tells the environment and the policy.
#' @param xlab,ylab The axes' labels; the default are the names of the parts.
#' @param ... Further arguments of [plot()][graphics::plot.default()]; not used by
#'   `autoplot()`.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @export
#' @examples
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 0.3), nrow = 1)))
#' plot(decision_map(follow, x = 3, y = 4, xlim = c(-0.2, 0.2), ylim = c(-3, 3)))
plot.gym_decision_map <- function(x, main = NULL, xlab = x$x, ylab = x$y, ...) {
  data <- decision_plot_data(x)
  open_plot(
    list(x = range(data$x), y = range(data$y), xlab = xlab, ylab = ylab, xaxs = "i", yaxs = "i"),
    list(...)
  )
  draw_field(data)
  draw_regions(data$regions)
  draw_path(data$path)
  graphics::box(bty = "l")
  graphics::title(main = main %||% decision_title(x), line = 2.5)
  colour_key_above(data$key)
  invisible(x)
}

decision_title <- function(x) {
  policy <- sub("(,| over).*", "", policy_text(x$policy))
  paste0(c(x$env_id, paste0("policy: ", policy)), collapse = ", ")
}

# What plot() and autoplot() of a policy do with the names of two observations.
plot_decision <- function(policy, env = NULL, x = NULL, y = NULL, ..., main = NULL) {
  arguments <- list(...)
  own <- names(arguments) %in% names(formals(decision_map))
  map <- do.call(decision_map, c(list(policy, env, x, y), arguments[own]))
  do.call(graphics::plot, c(list(map, main = main), arguments[!own]))
}

autoplot_decision <- function(policy, env = NULL, x = NULL, y = NULL, ...) {
  autoplot.gym_decision_map(decision_map(policy, env, x, y, ...))
}

# In `plot(policy, env, x = "pole_angle", y = "pole_angular_velocity")` it is the string
# that plot() dispatches on, by the name of its own first argument. Other strings are
# plotted as ever.
#' @export
plot.character <- function(x, y = NULL, ...) {
  name <- names(substitute(list(...)))[2L]
  # What has another name belongs to plot.default(), and may be meant to be evaluated late.
  first <- if (...length() && (name %||% "") %in% c("", "policy")) ..1
  if (inherits(first, "gym_policy") || is.function(first)) {
    return(plot_decision(..., x = x, y = y))
  }
  NextMethod()
}

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

output_colours <- function(x, data) {
  palette <- diverging_colours()
  region <- 1 + (data$z > 0.5)
  list(
    zlim = c(0, 1), palette = palette, border = 0.5,
    regions = region_labels(data, region, x$actions),
    key = list(palette = palette, ends = c("0", "1"), label = "output")
  )
}

value_colours <- function(x, data) {
  palette <- diverging_colours()
  limits <- x$limits %||% range(data$z)
  # Of one colour where there is but one value.
  zlim <- if (diff(limits) > 0) limits else limits + c(-1, 1)
  list(
    zlim = zlim, palette = palette, border = mean(zlim), regions = NULL,
    key = list(palette = palette, ends = number_text_each(zlim), label = x$actions)
  )
}

choice_colours <- function(x, data) {
  n <- length(x$actions)
  region <- match(data$z, sort(unique(as.vector(data$z))))
  taken <- sort(unique(as.vector(data$z)))
  first <- suppressWarnings(as.numeric(sub(":.*", "", x$actions[[1L]])))
  names <- x$actions[taken - first + 1]
  region <- matrix(region, nrow(data$z))
  list(
    zlim = first + c(-0.5, n - 0.5), palette = choice_palette(n), border = NULL,
    regions = region_labels(data, region, names), key = NULL
  )
}

# From one action to the other: light to dark as well, for print without colours.
diverging_colours <- function() {
  grDevices::colorRampPalette(c("#FDE9C4", "#F2C879", "#F7F7F7", "#7FB6DA", okabe_ito$blue))(101L)
}

choice_palette <- function(n) {
  colours <- c("#FBE3B4", okabe_ito$sky_blue, okabe_ito$green, okabe_ito$purple, okabe_ito$yellow,
               okabe_ito$vermillion, okabe_ito$blue, okabe_ito$orange)
  if (n <= length(colours)) colours[seq_len(n)] else grDevices::hcl.colors(n, "viridis")
}

#' Find places for the names of regions
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

# By peeling off what borders on the outside until nothing is left: what was last there
# lies in the middle.
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

# A field of colours over the plot, with the lines of levels where there are any.
draw_field <- function(data) {
  graphics::image(data$x, data$y, data$z, zlim = data$zlim, col = data$palette, add = TRUE,
                  useRaster = TRUE)
  within <- range(data$z, na.rm = TRUE)
  border <- data$border[data$border > within[[1L]] & data$border < within[[2L]]]
  if (length(border)) {
    graphics::contour(data$x, data$y, data$z, levels = border, add = TRUE, lwd = 2,
                      drawlabels = FALSE)
  }
}

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
    graphics::lines(episode$x, episode$y, col = "white", lwd = 4)
    graphics::lines(episode$x, episode$y, lwd = 1.5)
    graphics::points(episode$x[[1L]], episode$y[[1L]], pch = 21L, bg = "white", lwd = 2, cex = 1.4)
    graphics::points(episode$x[[last]], episode$y[[last]], pch = 4L, lwd = 3, cex = 1.4)
  }
}

#' Draw a bar of colours with its ends' values in one line above the plot
#' @param key A list: `palette`, `ends` (two strings), `label`; `NULL` for none.
#' @noRd
colour_key_above <- function(key, cex = 0.9) {
  if (is.null(key)) {
    return(invisible())
  }
  width <- function(text) graphics::strwidth(text, "inches", cex = cex)
  em <- graphics::strwidth("M", "inches", cex = cex)
  texts <- width(key$label) + width(key$ends[[1L]]) + width(key$ends[[2L]]) + 3 * em
  sides <- graphics::grconvertX(0:1, "npc", "inches")
  long <- max(min(diff(sides) - texts, 12 * em), 3 * em)
  left <- mean(sides) - (long + texts) / 2
  label <- left + width(key$label) + em
  bar <- label + width(key$ends[[1L]]) + 0.6 * em
  height <- graphics::grconvertY(1, "npc", "inches") + 0.9 * graphics::par("csi")
  x <- function(inches) graphics::grconvertX(inches, "inches", "user")
  y <- function(inches) graphics::grconvertY(inches, "inches", "user")
  say <- function(inches, text) {
    graphics::text(x(inches), y(height), text, adj = c(0, 0.4), cex = cex, xpd = NA)
  }
  say(left, key$label)
  say(label, key$ends[[1L]])
  half <- 0.3 * graphics::par("csi")
  graphics::rasterImage(t(key$palette), x(bar), y(height - half), x(bar + long), y(height + half),
                        xpd = NA, interpolate = FALSE)
  graphics::rect(x(bar), y(height - half), x(bar + long), y(height + half), xpd = NA, lwd = 0.5)
  say(bar + long + 0.6 * em, key$ends[[2L]])
  invisible(list(left = left, right = left + long + texts))
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
  plot <- ggplot2::ggplot(points, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_raster(ggplot2::aes(fill = .data$z)) +
    ggplot2::scale_fill_gradientn(
      colours = data$palette, limits = data$zlim, name = data$key$label,
      guide = if (is.null(data$key)) "none" else "colourbar"
    ) +
    ggplot2::labs(title = decision_title(object), x = object$x, y = object$y) +
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
