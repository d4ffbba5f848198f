# Rewrites PNG files with at most 256 colours, which look the same and take half of the room: the
# installed package has to stay below five megabytes.
fewer_colours <- function(files) {
  for (file in files) {
    picture <- magick::image_quantize(
      magick::image_read(file), max = 256, colorspace = "sRGB", dither = FALSE
    )
    magick::image_write(picture, file, format = "png", depth = 8)
  }
}
