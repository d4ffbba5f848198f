#' Plot a decision map
#'
#' Show the actions of a policy over two parts of the observation. The colour is the output of a
#' network that is rounded to one of two actions, with a line at one half; or the action; or the
#' value of an action that is a Box, with a line at the middle of its bounds. Regions carry the
#' names of their actions. The path of an episode starts at the ring and ends at the cross.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [decision_map()].
#' @param xlab,ylab The axes' labels, strings. `NULL`, the default, uses the names of the parts,
#'   with their units if Gymnasium's documentation has them.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_decision_map
#' @exportS3Method ggplot2::autoplot
#' @examples
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 0.3), nrow = 1)))
#' plot(decision_map(policy = follow, x = 3, y = 4, xlim = c(-0.2, 0.2), ylim = c(-3, 3)))
autoplot.gym_decision_map <- function(object, ...) {
  check_dots_empty(...)
  data <- decision_plot_data(object)
  ggplot2::ggplot(data$points, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_raster(ggplot2::aes(fill = .data$shown)) +
    data$fill +
    border_line(data) +
    region_names(data$regions) +
    path_layers(object$path) +
    ggplot2::scale_x_continuous(expand = c(0, 0)) +
    ggplot2::scale_y_continuous(expand = c(0, 0)) +
    picture_labels(
      object$env_id %||% "Decision map", policy_subtitle(object),
      x = observation_labels(object$env_id, object$x),
      y = observation_labels(object$env_id, object$y)
    ) +
    theme_gym()
}

# The line between two actions, if both occur: ggplot2 warns about an empty line.
border_line <- function(data) {
  if (is.null(data$border)) {
    return(NULL)
  }
  inside <- range(data$points$shown)
  if (data$border > inside[[1L]] && data$border < inside[[2L]]) {
    ggplot2::geom_contour(
      ggplot2::aes(z = .data$shown), breaks = data$border, colour = "black", linewidth = 0.8
    )
  }
}

region_names <- function(regions) {
  if (NROW(regions)) {
    ggplot2::geom_text(
      ggplot2::aes(label = .data$label), regions, fontface = "bold", size = 3.5
    )
  }
}

path_layers <- function(path) {
  if (is.null(path)) {
    return(NULL)
  }
  ends <- function(last) path[!duplicated(path$episode, fromLast = last), ]
  several <- path[path$episode %in% path$episode[duplicated(path$episode)], ]
  way <- function(...) ggplot2::geom_path(ggplot2::aes(group = .data$episode), several, ...)
  list(
    way(colour = "white", linewidth = 1.5), way(linewidth = 0.5),
    ggplot2::geom_point(data = ends(FALSE), shape = 21, fill = "white", size = 3, stroke = 1),
    ggplot2::geom_point(data = ends(TRUE), shape = 4, size = 2.5, stroke = 1.5)
  )
}

#' Compute the data of a plot of a decision map
#' @return A list: `points` (data frame `x`, `y`, `shown`, a number or a factor), `fill` (the colour
#'   scale), `border` (the level of the border line, or `NULL`), `regions` (data frame: `x`, `y`,
#'   `label`).
#' @noRd
decision_plot_data <- function(x) {
  points <- stats::setNames(x$grid, c("x", "y", "shown"))
  switch(
    x$kind, output = output_map(x, points), choice = choice_map(x, points),
    value = value_map(x, points)
  )
}

# The colours span the range of the outputs around one half, because small weights make small
# differences.
output_map <- function(x, points) {
  reach <- max(abs(points$shown - 0.5), 0.01)
  list(
    points = points, fill = diverging_fill("output", 0.5 + c(-reach, reach)), border = 0.5,
    regions = region_labels(points, 1 + (points$shown > 0.5), x$actions)
  )
}

value_map <- function(x, points) {
  limits <- x$limits %||% range(points$shown)
  # One colour if there is only one value.
  limits <- if (diff(limits) > 0) limits else limits + c(-1, 1)
  list(points = points, fill = diverging_fill(x$actions, limits), border = mean(limits))
}

diverging_fill <- function(name, limits) {
  continuous_fill(name, diverging_colours, limits = limits)
}

choice_map <- function(x, points) {
  start <- as.integer(sub(":.*", "", x$actions[[1L]]))
  taken <- points$shown - start + 1
  regions <- region_labels(points, taken, x$actions)
  points$shown <- factor(x$actions[taken], x$actions)
  found <- levels(droplevels(points$shown))
  list(
    points = points, regions = regions,
    fill = ggplot2::scale_fill_manual(
      name = NULL, values = stats::setNames(action_colours(length(x$actions)), x$actions),
      # If all names are in the regions, a key is not needed.
      guide = if (all(found %in% regions$label)) "none" else rows_of_key(found)
    )
  )
}

#' Place the names of regions
#'
#' A name is at the point of its region that is farthest from other regions, if there is room.
#' @param region The number of each point's region, from 1.
#' @noRd
region_labels <- function(points, region, labels) {
  x <- unique(points$x)
  y <- unique(points$y)
  region <- matrix(region, length(x))
  found <- sort(unique(as.vector(region)))
  found <- found[vapply(found, function(i) mean(region == i), 0) > 0.02]
  at <- do.call(rbind, lapply(found, function(i) region_middle(region == i)))
  data.frame(x = x[at[, 1L]], y = y[at[, 2L]], label = labels[found])
}

# Remove border points again and again until none is left. The last ones are in the middle.
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
