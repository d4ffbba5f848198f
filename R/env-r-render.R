# Frames of environments written in R. The user's function either plots, on a png() device, or
# returns a picture.

# The size of a plot in pixels: that of CartPole's frames.
plotted_size <- c(width = 600L, height = 400L)

# A small picture, such as one pixel for each cell of a grid, is enlarged to about this width.
least_width <- 240L

check_renders <- function(sub_env, call = rlang::caller_env()) {
  if (is.null(sub_env$render)) {
    gym_abort(
      c(paste0(sub_env$traits$spec$id, " cannot be drawn."),
        i = "Give it a function `render` that draws it, see `?gym_env`."),
      class = "gym_error_argument", argument = "render", call = call
    )
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
  bytes <- plot_as_png(plotted_size, {
    picture <- withCallingHandlers(
      keep_random_state(sub_env$render()),
      error = function(cnd) abort_raised(cnd, sub_env, NULL, call, "render")
    )
  })
  if (is_picture(picture)) {
    frame_from_picture(picture, sub_env, call)
  } else if (is.null(bytes)) {
    gym_abort(
      c(paste0("`render()` of ", sub_env$traits$spec$id, " drew nothing and returned ",
               describe_argument(picture), "."),
        i = "It must plot, or return a raster image, a matrix or an array of height x width x 3."),
      class = "gym_error_argument", argument = "render", value = picture, call = call
    )
  } else {
    bytes
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

#' Run code that plots, on a device that writes a PNG file
#'
#' @param size Width and height in pixels.
#' @return The bytes of the file, `NULL` if nothing was plotted.
#' @noRd
plot_as_png <- function(size, code) {
  file <- temporary_file(fileext = ".png")
  on.exit(unlink(file))
  on_device(grDevices::png(file, size[[1L]], size[[2L]], res = 96), code)
  if (file.exists(file)) readBin(file, "raw", file.size(file))
}

# Pictures that are returned -----------------------------------------------------------

is_picture <- function(x) {
  grDevices::is.raster(x) || inherits(x, "gym_frame") ||
    (is.numeric(x) || is.character(x) || is.logical(x)) && length(dim(x)) %in% 2:3
}

frame_from_picture <- function(picture, sub_env, call) {
  if (inherits(picture, "gym_frame")) {
    return(picture)
  }
  tryCatch(
    {
      colours <- enlarge(as_colours(picture))
      channels <- grDevices::col2rgb(colours)
      new_frame(aperm(array(channels, c(3L, dim(colours))), c(2L, 3L, 1L)))
    },
    error = function(cnd) abort_raised(cnd, sub_env, NULL, call, "render")
  )
}

# The colours of a picture as a matrix. Numbers are shares of 1, or whole numbers up to 255.
as_colours <- function(picture) {
  raster <- if (is.numeric(picture)) {
    as.raster(picture, max = if (max(picture, 0, na.rm = TRUE) > 1) 255 else 1)
  } else {
    as.raster(picture)
  }
  # The elements of a raster image are in rows.
  matrix(as.character(as.matrix(raster)), nrow(raster))
}

enlarge <- function(pixels) {
  by <- ceiling(least_width / ncol(pixels))
  pixels[rep(seq_len(nrow(pixels)), each = by), rep(seq_len(ncol(pixels)), each = by), drop = FALSE]
}
