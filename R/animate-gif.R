# Writes a GIF file picture by picture: of each only the part that differs from the one before.
# ImageMagick can write a whole animation, too, but takes all of its
# pictures unpacked for that: a gigabyte for an episode of CartPole, half a minute, and
# more than many systems allow it.
#
# The format: CompuServe, "Graphics Interchange Format, Version 89a" (1990), and
# Netscape's extension that lets a GIF play again and again.

#' Write frames as a GIF file
#'
#' @param pngs A list of PNG files, each a raw vector, all of one size.
#' @param delays How long each is shown, in hundredths of a second.
#' @param width Of the pictures, in pixels; `NULL` for their own.
#' @noRd
write_gif <- function(pngs, file, delays, width = NULL) {
  out <- file(file, "wb")
  on.exit(close(out))
  before <- NULL
  for (i in seq_along(pngs)) {
    image <- magick::image_background(magick::image_read(pngs[[i]]), "white")
    if (!is.null(width)) {
      image <- magick::image_scale(image, as.character(width))
    }
    pixels <- magick::image_data(image, "rgb")
    if (is.null(before)) {
      writeBin(gif_header(dim(pixels)[2:3]), out)
    }
    part <- changed_part(before, pixels)
    writeBin(gif_picture(crop_image(image, part), part, delays[[i]]), out)
    before <- pixels
  }
  writeBin(as.raw(0x3b), out)
}

#' Find the smallest rectangle outside of which two pictures are the same
#' @param before,now Raw arrays of channels x width x height.
#' @return A list: `x`, `y` (the first column and row, from 0), `width`, `height`; a single
#'   pixel where nothing differs, all where there is nothing before.
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

# The colour space in which GIF files are written: from any other ImageMagick would look
# for colours once more, with dithering, in 128 MB and a tenth of a second each time.
crop_image <- function(image, part) {
  area <- magick::geometry_area(part$width, part$height, part$x, part$y)
  magick::image_quantize(
    magick::image_crop(image, area), max = 256, colorspace = "sRGB", dither = FALSE
  )
}

# The size of the pictures, no colour table for all of them, and the instruction to repeat forever.
gif_header <- function(size) {
  c(
    charToRaw("GIF89a"), two_bytes(size), as.raw(c(0x70, 0, 0)),
    as.raw(c(0x21, 0xff, 11)), charToRaw("NETSCAPE2.0"), as.raw(c(3, 1, 0, 0, 0))
  )
}

#' Make one picture of an animation
#' @param image The part of the picture that changed.
#' @param part Where it belongs, as [changed_part()] returns it.
#' @return A raw vector: how long it is shown (over the pictures before, which stay), its
#'   place, its colours, its pixels.
#' @noRd
gif_picture <- function(image, part, delay) {
  single <- gif_parts(in_plain_letters(magick::image_write(image, format = "gif")))
  c(
    as.raw(c(0x21, 0xf9, 4, 0x04)), two_bytes(delay), as.raw(c(0, 0)),
    as.raw(0x2c), two_bytes(c(part$x, part$y, part$width, part$height)),
    as.raw(0x80 + log2(length(single$colours) / 3) - 1),
    single$colours, single$pixels
  )
}

#' Take a GIF file of one picture apart
#' @return A list of raw vectors: `colours`, the table of them, and `pixels`, packed.
#' @noRd
gif_parts <- function(gif) {
  number <- function(at) as.integer(gif[[at]])
  # The flags say whether there is a table, and the binary logarithm of its length minus one.
  table_at <- function(flags, at) {
    if (number(flags) >= 0x80) seq(at, length.out = 3 * 2^(number(flags) %% 8 + 1))
  }
  table <- table_at(11L, 14L)
  at <- 14L + length(table)
  while (number(at) == 0x21) {
    at <- end_of_blocks(number, at + 2L)
  }
  own <- table_at(at + 9L, at + 10L)
  pixels <- at + 10L + length(own)
  list(
    colours = gif[own %||% table],
    pixels = gif[seq(pixels, end_of_blocks(number, pixels + 1L) - 1L)]
  )
}

# In a GIF file, data are blocks that begin with their length; a block of length 0 is the last.
end_of_blocks <- function(number, at) {
  while (number(at) > 0L) at <- at + number(at) + 1L
  at + 1L
}

# ImageMagick looks for the format "gif" in capital and in small letters, which in a Turkish locale
# are others.
in_plain_letters <- function(code) {
  locale <- Sys.getlocale("LC_CTYPE")
  on.exit(Sys.setlocale("LC_CTYPE", locale))
  Sys.setlocale("LC_CTYPE", "C")
  code
}

two_bytes <- function(x) writeBin(as.integer(x), raw(), size = 2L, endian = "little")
