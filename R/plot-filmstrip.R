# An episode on paper: some of its frames side by side.

#' Pick frames that are evenly apart, the first and the last among them
#' @param frames Of class `gym_frames`.
#' @return A list of `frames` and `steps`, after how many steps each was taken.
#' @noRd
pick_stills <- function(frames, n) {
  at <- unique(round(seq(1, length(frames), length.out = min(n, length(frames)))))
  list(frames = frames[at], steps = as.integer(at - 1))
}

plot_filmstrip <- function(x, episode, n, main, candidate, call = rlang::caller_env()) {
  check_count(n, call = call)
  stills <- pick_stills(episode_frames(x, episode, candidate, call), n)
  check_suggested("png", "draw a filmstrip", call)
  draw_filmstrip(stills, main)
}

draw_filmstrip <- function(stills, main = NULL) {
  pictures <- crop_blank(lapply(stills$frames, unclass))
  old <- graphics::par(mar = c(0.2, 0.2, if (is.null(main)) 0.2 else 2.2, 0.2), xpd = NA)
  on.exit(graphics::par(old))
  graphics::plot.new()
  inches <- graphics::par("pin")
  aspect <- ncol(pictures[[1L]]) / nrow(pictures[[1L]])
  grid <- arrange_stills(length(pictures), aspect, inches)
  graphics::plot.window(c(0, inches[[1L]]), c(0, inches[[2L]]), xaxs = "i", yaxs = "i")
  left <- (inches[[1L]] - grid$columns * grid$cell[[1L]] + grid$gap) / 2
  top <- (inches[[2L]] + grid$rows * grid$cell[[2L]]) / 2
  for (i in seq_along(pictures)) {
    x <- left + ((i - 1) %% grid$columns) * grid$cell[[1L]]
    y <- top - ((i - 1) %/% grid$columns) * grid$cell[[2L]] - grid$label
    picture <- shrink(pictures[[i]], device_shrinkage(pictures[[i]], grid$width))
    raster <- as.raster(new_frame(picture))
    graphics::rasterImage(raster, x, y - grid$height, x + grid$width, y)
    graphics::rect(x, y - grid$height, x + grid$width, y, border = "grey70", lwd = 0.8)
    graphics::text(x, y + 0.45 * grid$label, paste("step", stills$steps[[i]]), adj = c(0, 0.5),
                   cex = grid$cex)
  }
  if (!is.null(main)) graphics::title(main = main, line = 0.7)
}

#' Cut off what is blank around all of several pictures
#'
#' Blank is what has the colour of a picture's corner. Some of it stays.
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

# Devices that draw pixels leave out most pixels of a large picture, and thin lines with them. For
# these it is made smaller beforehand, by this factor.
device_shrinkage <- function(picture, inches) {
  if (names(grDevices::dev.cur()) %in% c("pdf", "postscript", "svg", "cairo_pdf", "cairo_ps")) {
    return(1L)
  }
  pixels <- inches * grDevices::dev.size("px")[[1L]] / grDevices::dev.size("in")[[1L]]
  max(1L, as.integer(ncol(picture) / pixels))
}

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

#' Arrange pictures so that they are as large as may be
#'
#' Full rows look better, if the pictures are not much smaller for it.
#' @param aspect Their width by their height.
#' @param inches Width and height of the page.
#' @return A list, all but the counts in inches: `columns`, `rows`, `width` and `height` of a
#'   picture, `label` (the room above it), `gap` (between two), `cell` (width and height of
#'   all of it), and `cex` for the label.
#' @noRd
arrange_stills <- function(n, aspect, inches) {
  columns <- seq_len(n)
  rows <- ceiling(n / columns)
  full <- columns * rows == n
  of_columns <- function(columns, rows) {
    width <- inches[[1L]] / columns
    min(width, aspect * (inches[[2L]] / rows - label_room(width / aspect)))
  }
  widths <- mapply(of_columns, columns, rows)
  good <- full & widths >= 2 / 3 * max(widths)
  best <- if (any(good)) which(good)[which.max(widths[good])] else which.max(widths)
  width <- max(widths[[best]], 0.1)
  gap <- 0.04 * width
  label <- label_room(width / aspect)
  picture <- width - gap
  list(
    columns = columns[[best]], rows = rows[[best]], width = picture, height = picture / aspect,
    label = label, gap = gap, cell = c(width, picture / aspect + label + gap / 2),
    cex = 0.85 * label / 0.22 / graphics::par("cex")
  )
}

# The height of the label above a picture: a part of the picture's, but never too small to read.
label_room <- function(height) min(max(0.2 * height, 0.13), 0.22)

# The size of a filmstrip on paper: as wide as the text of a page.
filmstrip_size <- function(stills, width = 6.5) {
  picture <- crop_blank(lapply(stills$frames, unclass))[[1L]]
  n <- length(stills$steps)
  columns <- min(4L, n)
  rows <- ceiling(n / columns)
  c(width, rows * (width / columns * nrow(picture) / ncol(picture) + 0.25))
}
