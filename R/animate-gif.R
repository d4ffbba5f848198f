#' Write frames as a GIF file
#'
#' Each frame keeps only the part that differs from the one before. With whole frames ImageMagick
#' would need a gigabyte for an episode of CartPole, more than many systems allow.
#'
#' @param pngs A list of PNG files, each a raw vector, all of one size.
#' @param delays The time for each frame, in hundredths of a second.
#' @param width The width in pixels; `NULL` for the frames' own.
#' @return The size of the frames in pixels, width and height.
#' @noRd
write_gif <- function(pngs, file, delays, width = NULL) {
  before <- NULL
  parts <- vector("list", length(pngs))
  for (i in seq_along(pngs)) {
    image <- magick::image_background(magick::image_read(pngs[[i]]), "white")
    if (!is.null(width)) image <- magick::image_scale(image, as.character(width))
    pixels <- magick::image_data(image, "rgb")
    # A part keeps its place and its delay, and stays until the next one covers it.
    image <- magick::image_animate(image, delay = delays[[i]], dispose = "none")
    parts[[i]] <- crop_image(image, changed_part(before, pixels))
    before <- pixels
  }
  gif <- magick::image_write(magick::image_join(parts), format = "gif")
  writeBin(gif, file)
  dim(pixels)[2:3]
}

#' Find the smallest rectangle that contains all differences of two frames
#' @param before,now Raw arrays of channels x width x height.
#' @return A list: `x`, `y` (the first column and row, from 0), `width`, `height`; a single pixel if
#'   nothing differs, the whole frame if there is none before.
#' @noRd
changed_part <- function(before, now) {
  size <- dim(now)[2:3]
  if (is.null(before)) {
    return(list(x = 0L, y = 0L, width = size[[1L]], height = size[[2L]]))
  }
  differs <- matrix(colSums(matrix(before != now, nrow = dim(now)[[1L]])) > 0, size[[1L]])
  span <- function(which) if (length(which)) range(which) else c(1L, 1L)
  x <- span(which(rowSums(differs) > 0))
  y <- span(which(colSums(differs) > 0))
  list(x = x[[1L]] - 1L, y = y[[1L]] - 1L, width = diff(x) + 1L, height = diff(y) + 1L)
}

# The colour space of GIF files. From any other one ImageMagick would choose colours again, with
# dithering, in 128 MB and a tenth of a second per frame.
crop_image <- function(image, part) {
  area <- magick::geometry_area(part$width, part$height, part$x, part$y)
  magick::image_quantize(
    magick::image_crop(image, area, repage = FALSE), max = 256, colorspace = "sRGB", dither = FALSE
  )
}
