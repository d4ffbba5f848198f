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
      env_text(object) %||% "Decision map", policy_subtitle(object),
      x = observation_labels(described_id(object), object$x),
      y = observation_labels(described_id(object), object$y)
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
    regions = region_labels(points, 1 + (points$shown > 0.5), x$actions, x$path, needed = TRUE)
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
  numbers <- start + seq_along(x$actions) - 1L
  # Of many actions the key is a scale.
  few <- length(numbers) <= most_named_actions
  regions <- if (few) region_labels(points, taken, x$actions, x$path)
  points$shown <- shown_actions(points$shown, numbers, x$actions)
  found <- x$actions[sort(unique(taken))]
  list(
    points = points, regions = regions,
    fill = action_fill(
      numbers, x$actions, taken = found,
      # If all names are in the regions, a key is not needed.
      guide = if (all(found %in% regions$label)) "none" else rows_of_key(found)
    )
  )
}

#' Place the names of regions
#'
#' A name is in the middle of the places in its region where it fits and does not cover the path. If
#' there is none, the path does not count, and if there is still none, there is no name.
#' @param region The number of each point's region, from 1.
#' @param path The path of episodes, or `NULL`.
#' @param needed Whether a region has a name even if it does not fit, because no key has it.
#' @noRd
region_labels <- function(points, region, labels, path = NULL, needed = FALSE) {
  x <- unique(points$x)
  y <- unique(points$y)
  region <- matrix(region, length(x))
  crossed <- path_cells(path, x, y)
  found <- sort(unique(as.vector(region)))
  found <- found[vapply(found, function(i) mean(region == i), 0) > 0.02]
  at <- lapply(found, function(i) {
    inside <- region == i
    room <- room_for_name(inside & !crossed, labels[[i]])
    if (!any(room)) room <- room_for_name(inside, labels[[i]])
    if (any(room)) region_middle(room) else if (needed) region_middle(inside)
  })
  there <- lengths(at) > 0L
  at <- matrix(as.integer(unlist(at)), ncol = 2L, byrow = TRUE)
  data.frame(x = x[at[, 1L]], y = y[at[, 2L]], label = labels[found[there]])
}

# The places around which a name fits into an area of points, in a picture of four inches, whose
# panel is about 3.2 inches wide and 2 inches high.
room_for_name <- function(inside, label) {
  reach <- ceiling(dim(inside) * c(0.042 * nchar(label) / 3.2, 0.1 / 2))
  t(within_reach(t(within_reach(inside, reach[[1L]])), reach[[2L]]))
}

# The cells of a column that have only `TRUE` this far above and below.
within_reach <- function(inside, reach) {
  n <- nrow(inside)
  outside <- apply(rbind(0, !inside), 2L, cumsum)
  fits <- seq_len(n) > reach & seq_len(n) <= n - reach
  at <- which(fits)
  free <- outside[at + reach + 1L, , drop = FALSE] == outside[at - reach, , drop = FALSE]
  inside[] <- FALSE
  inside[at, ] <- free
  inside
}

# The points of a map that a path crosses, with the lines between its steps.
path_cells <- function(path, x, y) {
  crossed <- matrix(FALSE, length(x), length(y))
  nearest <- function(values, at) round((values - at[[1L]]) / (at[[2L]] - at[[1L]])) + 1
  for (way in if (!is.null(path)) split(path, path$episode)) {
    n <- nrow(way)
    between <- if (n > 1L) seq(1, n, by = 0.05) else 1
    part <- function(values) if (n > 1L) stats::approx(seq_len(n), values, between)$y else values
    cells <- cbind(nearest(part(way$x), x), nearest(part(way$y), y))
    shown <- cells[, 1L] %in% seq_along(x) & cells[, 2L] %in% seq_along(y)
    crossed[cells[shown, , drop = FALSE]] <- TRUE
  }
  crossed
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
