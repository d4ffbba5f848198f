#' Write frames as a GIF file
#'
#' Writes only the part of each frame that differs from the frame before. With whole frames,
#' ImageMagick needs a gigabyte for an episode of CartPole, and many systems allow less.
#'
#' @param pngs A list of PNG files, each a raw vector, all of one size.
#' @param delays The time for each frame, in hundredths of a second.
#' @param width The width in pixels. `NULL` keeps the width of the frames.
#' @return The size of the frames in pixels, width and height.
#' @noRd
write_gif <- function(pngs, file, delays, width = NULL) {
  before <- NULL
  parts <- vector("list", length(pngs))
  for (i in seq_along(pngs)) {
    image <- magick::image_background(magick::image_read(pngs[[i]]), "white")
    if (!is.null(width)) image <- magick::image_scale(image, as.character(width))
    pixels <- magick::image_data(image, "rgb")
    # With `dispose = "none"` a part stays on the screen until a later part covers it.
    image <- magick::image_animate(image, delay = delays[[i]], dispose = "none")
    part <- changed_part(before, pixels)
    area <- magick::geometry_area(part$width, part$height, part$x, part$y)
    # GIF files are in sRGB. From any other colour space, ImageMagick would choose the colours of
    # each frame a second time, with dithering, which takes 128 MB and a tenth of a second.
    parts[[i]] <- magick::image_quantize(
      magick::image_crop(image, area, repage = FALSE), max = 256, colorspace = "sRGB",
      dither = FALSE
    )
    before <- pixels
  }
  gif <- magick::image_write(magick::image_join(parts), format = "gif")
  writeBin(gif, file)
  dim(pixels)[2:3]
}

#' Find the smallest rectangle that contains all differences of two frames
#' @param before,now Raw arrays of channels x width x height.
#' @return A list: `x`, `y` (the first column and row, from 0), `width`, `height`. It is a single
#'   pixel if nothing differs, and the whole frame if `before` is `NULL`.
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

# MP4 -------------------------------------------------------------------------------------

# The package av writes MP4 files. Without it, the program ffmpeg does, which the server's extra
# "video" includes.

#' Write frames as an MP4 file
#' @param fps The number of frames per second.
#' @inheritParams write_gif
#' @return The width and the height of the video in pixels. The format yuv420p needs even numbers.
#' @noRd
write_mp4 <- function(pngs, file, fps, width = NULL, call) {
  folder <- temporary_file()
  dir.create(folder)
  on.exit(unlink(folder, recursive = TRUE))
  # Repeat the last frame, so that it stays for a second.
  shown <- c(seq_along(pngs), rep(length(pngs), max(0, round(fps) - 1)))
  pictures <- file.path(folder, sprintf("%06d.png", seq_along(shown)))
  Map(writeBin, pngs[shown], pictures)
  own <- png_size(pngs[[1L]])
  width <- width %||% own[[1L]]
  even <- function(pixels) max(2L, 2L * as.integer(pixels %/% 2))
  size <- c(even(width), even(width * own[[2L]] / own[[1L]]))
  filter <- paste0("scale=", size[[1L]], ":", size[[2L]], ",format=yuv420p")
  if (is_av_there()) {
    av::av_encode_video(pictures, file, framerate = fps, vfilter = filter, verbose = FALSE)
    return(size)
  }
  run <- run_quietly(find_ffmpeg(), c(
    "-y", "-loglevel", "error", "-framerate", format(fps, digits = 15L),
    "-i", file.path(folder, "%06d.png"), "-vf", filter, file
  ), timeout = Inf)
  if (!identical(run$status, 0L)) {
    abort_wrong("file", file, call, "ffmpeg wrote no video.", x = run$stderr)
  }
  size
}

is_av_there <- function() requireNamespace("av", quietly = TRUE)

# Finds the system's ffmpeg. If there is none, looks in the Pythons of the session's servers, of the
# installed server and of GYM_PYTHON.
find_ffmpeg <- function() {
  found <- unname(Sys.which("ffmpeg"))
  if (nzchar(found)) {
    return(found)
  }
  pythons <- c(lapply(the_session$servers, function(server) server$python),
               installed_server()$python, Sys.getenv("GYM_PYTHON"))
  for (python in unique(Filter(nzchar, unlist(pythons)))) {
    where <- "import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())"
    said <- run_quietly(python, c("-c", where))
    path <- trimws(said$stdout)
    if (identical(said$status, 0L) && file.exists(path)) {
      return(path)
    }
  }
}
