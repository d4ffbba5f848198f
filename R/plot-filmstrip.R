# An episode on paper: some of its frames side by side.

#' Pick evenly spaced frames, including the first and the last
#' @param frames Of class `gym_frames`.
#' @return A list of `frames` and `steps`, the number of steps before each.
#' @noRd
pick_stills <- function(frames, n) {
  at <- unique(round(seq(1, length(frames), length.out = min(n, length(frames)))))
  list(frames = frames[at], steps = as.integer(at - 1))
}

filmstrip_picture <- function(x, episode, n, candidate, call = rlang::caller_env()) {
  check_count(n, call = call)
  stills <- pick_stills(episode_frames(x, episode, candidate, call), n)
  check_suggested("png", "draw a filmstrip", call)
  filmstrip(stills)
}

filmstrip <- function(stills) {
  pictures <- crop_blank(lapply(stills$frames, unclass))
  grob_picture(grid::gTree(pictures = pictures, steps = stills$steps, cl = "gym_filmstrip"))
}

# The arrangement of frames depends on the space available, which is known only when drawing.
#' @exportS3Method grid::makeContent
makeContent.gym_filmstrip <- function(x) { # nolint: object_name_linter.
  room <- grid::unit(1, "npc")
  inches <- c(grid::convertWidth(room, "in", TRUE), grid::convertHeight(room, "in", TRUE))
  aspect <- ncol(x$pictures[[1L]]) / nrow(x$pictures[[1L]])
  strip <- arrange_stills(length(x$pictures), aspect, inches)
  drawn <- lapply(seq_along(x$pictures), function(i) {
    draw_still(x$pictures[[i]], x$steps[[i]], i, strip, inches)
  })
  grid::setChildren(x, do.call(grid::gList, drawn))
}

draw_still <- function(picture, step, i, strip, inches) {
  left <- (inches[[1L]] - strip$columns * strip$cell[[1L]] + strip$gap) / 2 +
    ((i - 1) %% strip$columns) * strip$cell[[1L]]
  top <- (inches[[2L]] + strip$rows * strip$cell[[2L]]) / 2 -
    ((i - 1) %/% strip$columns) * strip$cell[[2L]] - strip$label
  inch <- function(x) grid::unit(x, "in")
  raster <- as.raster(new_frame(shrink(picture, device_shrinkage(picture, strip$width))))
  place <- list(
    x = inch(left), y = inch(top), width = inch(strip$width), height = inch(strip$height),
    just = c("left", "top")
  )
  grid::grobTree(
    do.call(grid::rasterGrob, c(list(raster), place)),
    do.call(grid::rectGrob, c(place, list(gp = grid::gpar(col = "grey70", fill = NA, lwd = 0.8)))),
    grid::textGrob(
      paste("step", step), inch(left), inch(top + 0.45 * strip$label), just = c("left", "centre"),
      gp = grid::gpar(fontsize = strip$fontsize)
    )
  )
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

# Pixel devices drop most pixels of a large picture, and thin lines with them. For these it is made
# smaller first, by this factor.
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

#' Arrange frames so that they are as large as possible
#'
#' Full rows look better, if the frames do not become much smaller.
#' @param aspect Width divided by height of a frame.
#' @param inches Width and height of the page.
#' @return A list, in inches except for the counts: `columns`, `rows`, `width` and `height` of a
#'   frame, `label` (the height of the label above it), `gap` (between two frames), `cell` (total
#'   width and height), and `fontsize` of the label.
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
    fontsize = 10 * label / 0.22
  )
}

# The height of the label above a frame: proportional to the frame, but never too small to read.
label_room <- function(height) min(max(0.2 * height, 0.13), 0.22)

# The size of a filmstrip on paper: as wide as the text of a page.
filmstrip_size <- function(stills, width = 6.5) {
  picture <- crop_blank(lapply(stills$frames, unclass))[[1L]]
  n <- length(stills$steps)
  columns <- min(4L, n)
  rows <- ceiling(n / columns)
  c(width, rows * (width / columns * nrow(picture) / ncol(picture) + 0.25))
}
