# Frames of environments written in R. The user's function either plots, on a png() device, or
# returns a picture.

# The size of a plot in pixels: that of CartPole's frames.
plotted_size <- c(width = 600L, height = 400L)

# A small picture, such as one pixel for each cell of a grid, is enlarged to about this width.
least_width <- 240L

check_renders <- function(sub_env, call = rlang::caller_env()) {
  if (is.null(sub_env$render)) {
    abort_wrong("render", NULL, call, "{sub_env$traits$spec$id} cannot be drawn.",
                i = "Give it a function `render` that draws it, see `?gym_env`.")
  }
}

# The current frame as the bytes of a PNG file.
sub_env_png <- function(sub_env, call = rlang::caller_env()) {
  drawn <- draw_sub_env(sub_env, call)
  if (is.raw(drawn)) {
    return(drawn)
  }
  check_suggested("png", "keep frames", call)
  png::writePNG(unclass(drawn) / 255)
}

#' Call the user's function that draws
#' @return The bytes of a PNG file if it plots, a `gym_frame` if it returns a picture.
#' @noRd
draw_sub_env <- function(sub_env, call) {
  picture <- NULL
  file <- temporary_file(fileext = ".png")
  on.exit(unlink(file))
  on_device(grDevices::png(file, plotted_size[[1L]], plotted_size[[2L]], res = 96), {
    picture <- withCallingHandlers(
      keep_random_state(sub_env$render()),
      error = function(cnd) abort_raised(cnd, sub_env, NULL, call, "render")
    )
  })
  array <- (is.numeric(picture) || is.character(picture) || is.logical(picture)) &&
    length(dim(picture)) %in% 2:3
  if (inherits(picture, "gym_frame")) {
    picture
  } else if (grDevices::is.raster(picture) || array) {
    frame_from_picture(picture, sub_env, call)
  } else if (!file.exists(file)) {
    abort_wrong("render", picture, call,
                "`render()` of {sub_env$traits$spec$id} drew nothing and returned
                 {describe_argument(picture)}.",
                i = "It must plot, or return a raster image, a matrix or an array of height x width
                     x 3.")
  } else {
    readBin(file, "raw", file.size(file))
  }
}

# Runs code that plots on the device that `open` opens. The current device stays current.
on_device <- function(open, code) {
  before <- grDevices::dev.cur()
  open
  device <- grDevices::dev.cur()
  on.exit({
    grDevices::dev.off(device)
    if (before > 1L) grDevices::dev.set(before)
  })
  code
}

# Pictures that are returned -----------------------------------------------------------

frame_from_picture <- function(picture, sub_env, call) {
  tryCatch(
    {
      # Numbers are shares of 1, or whole numbers up to 255.
      most <- if (is.numeric(picture) && max(picture, 0, na.rm = TRUE) > 1) 255 else 1
      raster <- if (is.numeric(picture)) as.raster(picture, max = most) else as.raster(picture)
      # The elements of a raster image are in rows.
      colours <- matrix(as.character(as.matrix(raster)), nrow(raster))
      by <- ceiling(least_width / ncol(colours))
      rows <- rep(seq_len(nrow(colours)), each = by)
      colours <- colours[rows, rep(seq_len(ncol(colours)), each = by), drop = FALSE]
      channels <- grDevices::col2rgb(colours)
      new_frame(aperm(array(channels, c(3L, dim(colours))), c(2L, 3L, 1L)))
    },
    error = function(cnd) abort_raised(cnd, sub_env, NULL, call, "render")
  )
}
