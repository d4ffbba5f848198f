# What the vignettes and the tools share that makes pictures small: the installed package has to
# stay below five megabytes.

# Rewrites PNG files with fewer colours. They look the same and take a third of the room.
fewer_colours <- function(files, max = 32) {
  for (file in files) {
    picture <- magick::image_quantize(
      magick::image_read(file), max = max, colorspace = "sRGB", dither = FALSE
    )
    magick::image_write(picture, file, format = "png", depth = 8)
  }
}

# Sets the options of a vignette's chunks. Their pictures get fewer colours if magick is there. The
# site has room, so its pictures stay as pkgdown draws them.
set_up_pictures <- function(height, colours = 32) {
  knitr::opts_chunk$set(collapse = TRUE, comment = "#>", fig.width = 7, fig.height = height)
  if (identical(Sys.getenv("IN_PKGDOWN"), "true")) {
    return(invisible())
  }
  knitr::opts_chunk$set(dpi = 64, dev = "png", dev.args = list(antialias = "none"))
  write_link <- knitr::knit_hooks$get("plot")
  knitr::knit_hooks$set(plot = function(x, options) {
    was_drawn <- startsWith(x, options$fig.path) && grepl("[.]png$", x)
    if (was_drawn && requireNamespace("magick", quietly = TRUE)) fewer_colours(x, colours)
    write_link(x, options)
  })
}
