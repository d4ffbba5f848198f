# Some frames of an episode, side by side.

#' Pick evenly spaced frames, including the first and the last
#' @param frames Of class `gym_frames`.
#' @return A list of `frames` and `steps`, the number of steps before each.
#' @noRd
pick_stills <- function(frames, n) {
  at <- unique(round(seq(1, length(frames), length.out = min(n, length(frames)))))
  list(frames = frames[at], steps = as.integer(at - 1))
}

# A panel for each frame.
filmstrip <- function(stills) {
  pictures <- crop_blank(lapply(stills$frames, unclass))
  width <- ncol(pictures[[1L]])
  height <- nrow(pictures[[1L]])
  names <- factor(paste("step", stills$steps), paste("step", stills$steps))
  frame_layer <- function(picture, name) {
    ggplot2::layer(
      geom = ggplot2::GeomRasterAnn, stat = "identity", position = "identity",
      data = data.frame(step = name), inherit.aes = FALSE,
      params = list(
        raster = as.raster(new_frame(shrink(picture, max(1L, width %/% most_pixels)))),
        xmin = 0, xmax = width, ymin = 0, ymax = height, interpolate = TRUE
      )
    )
  }
  ggplot2::ggplot() +
    ggplot2::geom_blank(
      ggplot2::aes(.data$x, .data$y), data.frame(x = c(0, width), y = c(0, height))
    ) +
    Map(frame_layer, pictures, as.list(names)) +
    ggplot2::facet_wrap(ggplot2::vars(.data$step), ncol = film_columns(pictures)) +
    ggplot2::scale_x_continuous(expand = c(0, 0)) +
    ggplot2::scale_y_continuous(expand = c(0, 0)) +
    ggplot2::coord_fixed() +
    theme_gym_bare() +
    ggplot2::theme(
      panel.border = ggplot2::element_rect(colour = "grey70", fill = NA),
      strip.text = ggplot2::element_text(margin = ggplot2::margin(2, 2, 2, 2)),
      plot.margin = ggplot2::margin(2, 2, 2, 2)
    )
}

# How many frames fit in a row and stay large.
film_columns <- function(pictures) {
  wide <- ncol(pictures[[1L]]) > 2 * nrow(pictures[[1L]])
  min(length(pictures), if (wide) 2L else 4L)
}

#' Crop the blank border that all frames share
#'
#' Blank means the colour of a frame's corner. A margin remains.
#' @param pictures Arrays of height x width x channels, all of one size.
#' @noRd
crop_blank <- function(pictures) {
  busy <- Reduce(`|`, lapply(pictures, function(picture) {
    corner <- rep(picture[1L, 1L, ], each = prod(dim(picture)[1:2]))
    rowSums(matrix(picture != corner, ncol = dim(picture)[[3L]])) > 0
  }))
  busy <- matrix(busy, nrow(pictures[[1L]]))
  if (!any(busy)) {
    return(pictures)
  }
  rows <- busy_span(rowSums(busy) > 0)
  columns <- busy_span(colSums(busy) > 0)
  lapply(pictures, function(picture) picture[rows, columns, , drop = FALSE])
}

busy_span <- function(busy) {
  around <- ceiling(length(busy) / 20)
  seq(max(1, min(which(busy)) - around), min(length(busy), max(which(busy)) + around))
}

# A graphics device drops most pixels of a large picture, and so loses thin lines. Shrink the
# picture first, but keep at least this width. The result is less than twice as wide.
most_pixels <- 300L

#' Make a picture smaller: each pixel the mean of a square
#' @noRd
shrink <- function(picture, by) {
  if (by == 1L) {
    return(picture)
  }
  size <- dim(picture)[1:2] %/% by
  channel <- function(i) {
    values <- picture[seq_len(size[[1L]] * by), seq_len(size[[2L]] * by), i]
    across <- colSums(array(values, c(by, size[[1L]], size[[2L]] * by)))
    sums <- rowSums(aperm(array(across, c(size[[1L]], by, size[[2L]])), c(1L, 3L, 2L)), dims = 2L)
    as.integer(round(sums / by^2))
  }
  array(vapply(seq_len(dim(picture)[[3L]]), channel, integer(prod(size))),
        c(size, dim(picture)[[3L]]))
}

# The size of a filmstrip on paper: as wide as the text of a page.
filmstrip_size <- function(stills) {
  width <- 6.5
  pictures <- crop_blank(lapply(stills$frames, unclass))
  columns <- film_columns(pictures)
  rows <- ceiling(length(pictures) / columns)
  c(width, rows * (width / columns * nrow(pictures[[1L]]) / ncol(pictures[[1L]]) + 0.25))
}

# A single frame -----------------------------------------------------------------------

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
