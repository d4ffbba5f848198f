# Episodes as MP4 files, written by the package av or by the program ffmpeg, which the server's
# extra "video" includes.

#' Write frames as an MP4 file
#' @param fps The number of frames per second.
#' @inheritParams write_gif
#' @return The size of the frames in pixels, width and height, which are even in most videos.
#' @noRd
write_mp4 <- function(pngs, file, fps, width = NULL, call = rlang::caller_env(2)) {
  folder <- temporary_file()
  dir.create(folder)
  on.exit(unlink(folder, recursive = TRUE))
  # The last frame stays for a second.
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
    gym_abort(
      c("ffmpeg wrote no video.", x = run$stderr), class = "gym_error_argument", argument = "file",
      value = file, call = call
    )
  }
  size
}

is_av_there <- function() requireNamespace("av", quietly = TRUE)

check_writes_mp4 <- function(call) {
  if (!is_av_there() && is.null(find_ffmpeg())) {
    gym_abort(
      c("Writing an MP4 file requires the package av or the program ffmpeg.",
        i = "`install.packages(\"av\")` installs the package; a .gif file needs neither."),
      class = "gym_error_argument", argument = "file", call = call
    )
  }
}

# The system's program, or that of the Python that runs, or would run, the session's server.
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
