#' Draw an environment's current frame
#'
#' Return a picture of the environment's current state from the server.
#'
#' @inheritParams env_reset
#' @param which For a vector environment: the number of the sub-environment to draw. The default is
#'   1, the first. An environment's own vector implementation (`"vector_entry_point"`) draws all
#'   sub-environments at once. The server allows this for at most 16.
#' @return An object of class `gym_frame`: an integer array of height x width x 3 (red, green, blue,
#'   each 0 to 255), for some environments height x width x 1 (grey) or x 4 (the last is the
#'   opacity). [plot()] shows it, [as.raster()] converts it to a raster image.
#' @section Errors: `gym_error_http_400` for an unknown instance, one that has not been reset yet
#'   (code `reset_needed`) or that cannot be drawn (code `cannot_render`); `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' env$reset()
#' frame <- env_render(env$client, env$instance_id)
#' plot(frame)
#' env$close()
env_render <- function(x, instance_id, which = 1) {
  check_client(x)
  check_string(instance_id)
  check_not_ended(x, instance_id)
  check_count(which)
  query <- if (which != 1) paste0("?sub_env=", whole_text(which - 1))
  route <- paste0(instance_route(instance_id), "render/", query)
  answer <- get_answer(x, route, takes_tensors = TRUE)
  new_frame(answer$tensors$frame)
}

new_frame <- function(values) structure(values, class = "gym_frame")

#' @importFrom grDevices as.raster
#' @export
as.raster.gym_frame <- function(x, ...) {
  values <- unclass(x)
  if (dim(values)[[3L]] == 1L) {
    # as.raster() expects shades of grey as a matrix.
    dim(values) <- dim(values)[1:2]
  }
  as.raster(values, max = 255L)
}

#' @export
print.gym_frame <- function(x, ...) {
  print_lines(x, paste0("<gym_frame: ", ncol(x), " x ", nrow(x), " pixels>"))
}

# The frames of an episode ----------------------------------------------------------------

# rollout(frames = TRUE) keeps the frames of an episode as PNG files: a frame of CartPole takes 3 MB
# as numbers and 3 kB as a PNG file.

#' Make the frames of an episode
#' @param files A list of PNG files, each a raw vector.
#' @param fps The number of frames per second, `NULL` if the environment does not say.
#' @return An object of class `gym_frames`: a list of PNG files, which `[[` unpacks.
#' @noRd
new_frames <- function(files, fps = NULL) {
  structure(files, fps = fps, class = "gym_frames")
}

#' @export
`[.gym_frames` <- function(x, i) new_frames(unclass(x)[i], attr(x, "fps"))

#' @export
`[[.gym_frames` <- function(x, i) frame_from_png(unclass(x)[[i]])

#' @export
print.gym_frames <- function(x, ...) print_line(x)

#' @export
format.gym_frames <- function(x, ...) {
  size <- if (length(x)) paste0(" of ", paste(png_size(unclass(x)[[1L]]), collapse = " x "))
  fps <- attr(x, "fps")
  pace <- if (!is.null(fps)) paste0(", ", number_text(fps), " a second")
  paste0("<gym_frames: ", count_of(length(x), "frame"), size, if (length(x)) " pixels", pace, ">")
}

# Pictures from the server --------------------------------------------------------

# Refuses, before play, an environment that cannot be drawn.
check_draws <- function(env, call) {
  label <- environment_label(env)
  if (!is.null(env$num_envs)) {
    abort_wrong("env", env, call,
                "Only an environment without sub-environments can keep frames, but this {label} has
                 {count_of(env$num_envs, 'sub-environment')}.",
                i = "Make it without `num_envs`, or give its id instead.")
  }
  draws <- FALSE
  if (is_server_env(env)) {
    check_open(env, call)
    draws <- known_instance(env$client, env$instance_id, call = call)$draws
  }
  if (!draws) {
    abort_wrong("frames", TRUE, call, "There are no frames to keep: {label} cannot be drawn.",
                i = "Leave out `frames = TRUE`; `steps = TRUE` keeps the observations.")
  }
}

# The current frame, as the bytes of a PNG file. The check uses the size in the header, because
# unpacking a huge picture would fill the memory.
png_frame <- function(client, instance_id, call = rlang::caller_env()) {
  route <- paste0(instance_route(instance_id), "render/")
  file <- get_answer(client, route, call = call)$png
  size <- png_size(file)
  if (!isTRUE(4 * prod(size) <= max_answer_bytes())) {
    abort_answer(paste("It is a picture of", paste(size, collapse = " x "), "pixels"))
  }
  file
}

# Width and height, from the header of the file.
png_size <- function(file) readBin(file[17:24], "integer", 2L, endian = "big")

#' Unpack a frame
#' @return An object of class `gym_frame`, as returned by [env_render()].
#' @noRd
frame_from_png <- function(file) {
  check_suggested("png", "unpack a frame")
  values <- png::readPNG(file)
  shape <- c(dim(values), 1L)[1:3]
  new_frame(array(as.integer(round(255 * values)), shape))
}

# Frames of environments written in R ------------------------------------------------------------

# The user's function either plots, on a png() device, or returns a picture.

# The size of a plot in pixels, the same as that of CartPole's frames.
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

# Runs code that plots on the device that `open` opens. Afterwards, the device that was current
# before is current again.
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
      # Numbers are from 0 to 1, or from 0 to 255.
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

# Watching and recording -------------------------------------------------------------------------

# A server shows an environment on a page. This opens the page for the user.

#' Watch an environment
#'
#' Open the page on which the server shows an environment live: its picture, the episode, the step,
#' the return so far and the returns of the last 100 episodes. An environment without pictures shows
#' its observations. Any number of people can watch, and each can pause it or slow it down for
#' themselves.
#'
#' An environment made with `render_mode = "human"` opens its page automatically, and so does the
#' first [env_step()] with `render = TRUE`.
#'
#' In an interactive session the page opens in RStudio's viewer or else in the browser. A script
#' shows the address once per environment, as a message of class `gym_message_watch`.
#' `options(gym.viewer = )` changes this, in scripts too. Give a function that takes the address,
#' such as [utils::browseURL()], or `FALSE` to open and show nothing. If the server requires a
#' token, the address contains a key for this page only.
#'
#' See `vignette("server", package = "gym")`, section "Watching", for the speed of the page and for
#' who can open it.
#'
#' @inheritParams env_reset
#' @return The page's address, a string, invisibly.
#' @section Errors: `gym_error_http_400` for an unknown instance; `gym_error_argument` if the option
#'   `gym.viewer` is neither a function nor `FALSE`; `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' address <- env_watch(env$client, env$instance_id)
#' address
#' env$reset()
#' for (i in 1:10) env$step(i %% 2)
#' env$close()
env_watch <- function(x, instance_id) {
  open_watch(known_instance(x, instance_id))
}

# Opens the page unless it was opened before.
watch_once <- function(instance, call = rlang::caller_env()) {
  if (is.null(instance$shown)) open_watch(instance, call)
}

open_watch <- function(instance, call = rlang::caller_env()) {
  viewer <- check_viewer(call)
  client <- instance$client
  # A browser sends no token. If the server requires one, the link has a key instead.
  key <- post_answer(client, paste0(instance$route, "watch/key/"), call = call)$key
  if (!is.null(key) && !(rlang::is_string(key) && grepl("^[A-Za-z0-9_-]{1,200}$", key))) {
    refuse_field(key, "key", "a string of letters and digits")
  }
  query <- if (!is.null(key)) paste0("?key=", key)
  address <- paste0(client$remote_base, instance$route, "watch/", query)
  # Set this first, so that a failing viewer fails only once.
  instance$shown <- TRUE
  comes <- FALSE
  if (open_address(address, viewer)) {
    deadline <- now() + watcher_timeout
    repeat {
      comes <- isTRUE(get_answer(client, instance$route)$watched)
      if (comes || now() >= deadline) break
      Sys.sleep(0.1)
    }
  }
  if (!comes && !isFALSE(viewer)) {
    rlang::inform(paste0("Watch ", instance$spec$id, " at ", address), class = "gym_message_watch")
  }
  invisible(address)
}

# In seconds.
watcher_timeout <- 5

#' Record an environment's episodes
#'
#' From the next reset on, the server writes a row for each finished episode into a table,
#' `episodes.csv`: its number, return, length in steps and seconds. It records videos of the
#' episodes that `video_callable` selects. `env_monitor_close()`, or closing the environment, ends
#' the monitor and finishes its files. Without a monitor, `env_monitor_close()` does nothing.
#'
#' @section Files: A monitor has its own directory, with the table, `episodes.csv`, and videos named
#'   by the number of their episode, such as `rl-video-episode-0.mp4`. If another monitor already
#'   writes in `directory`, of this or another server, the new monitor uses a directory below it,
#'   named by the `instance_id`, such as `1a2b3c4d`.
#'   `list.files(directory, "^episodes[.]csv$", recursive = TRUE)` finds all tables.
#' @inheritParams env_reset
#' @param directory The directory for the server's files, a string: a path below the server's
#'   directory for monitors (its option `--monitor-dir`), or, for a server on this machine, below
#'   the system's directory for temporary files. A server started from R without `monitor_dir` has a
#'   new temporary directory for relative paths. Use an absolute path, such as
#'   `file.path(tempdir(), "runs")`, or start the server by
#'   `gym_server_start(monitor_dir = "runs")`.
#' @param force Delete the files of monitors that were closed or ended with their server? Files of
#'   active monitors and all other files are never touched. The default is `FALSE`.
#' @param resume Continue the numbering of an earlier monitor? If this instance has its own
#'   directory below `directory`, this is the monitor there, otherwise the one in `directory`
#'   itself. The default, `FALSE`, refuses a directory with the files of an earlier monitor.
#' @param video_callable Which episodes to record as videos: `FALSE`, the default, for none, `TRUE`
#'   for all, or a whole number n for every n-th, starting with the first. Requires the server's
#'   extra `video` (the Python package moviepy). The server keeps the frames of an episode in memory
#'   until the episode ends: a thousand frames of CartPole take 720 MB.
#' @return Nothing, invisibly.
#' @section Errors: `gym_error_http_400` for an unknown instance, a directory that is refused, a
#'   monitor that is already active, or videos that cannot be made; the message gives the reason. If
#'   the monitor fails to record something, play goes on. The error comes when you close the monitor
#'   or the environment. `gym_error_argument`; `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' directory <- file.path(tempdir(), "cartpole")
#' env_monitor_start(env$client, env$instance_id, directory, force = TRUE)
#' invisible(rollout(env, policy_random(), episodes = 3))
#' env_monitor_close(env$client, env$instance_id)
#' read.csv(file.path(directory, "episodes.csv"))
#' env$close()
env_monitor_start <- function(x, instance_id, directory, force = FALSE, resume = FALSE,
                              video_callable = FALSE) {
  check_client(x)
  check_string(instance_id)
  check_not_ended(x, instance_id)
  check_string(directory)
  check_flag(force)
  check_flag(resume)
  if (!rlang::is_bool(video_callable)) check_count(video_callable)
  fields <- list(
    directory = path.expand(directory), force = force, resume = resume,
    video_callable = video_callable
  )
  post_answer(x, paste0(instance_route(instance_id), "monitor/start/"), json_texts(fields))
  invisible()
}

#' @rdname env_monitor_start
#' @export
env_monitor_close <- function(x, instance_id) {
  check_client(x)
  check_string(instance_id)
  check_not_ended(x, instance_id)
  post_answer(x, paste0(instance_route(instance_id), "monitor/close/"))
  invisible()
}
