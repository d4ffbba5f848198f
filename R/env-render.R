#' Draw an environment's current frame
#'
#' Return a picture of the environment's current state from the server.
#'
#' @inheritParams env_reset
#' @param which For a vector environment: the number of the sub-environment to draw. The default is
#'   1, the first. An environment's own vector implementation (`"vector_entry_point"`) draws all of
#'   them at once, which the server allows for at most 16.
#' @return An object of class `gym_frame`: an integer array of height x width x 3 (red, green, blue,
#'   each 0 to 255), or x 1 (grey) or x 4 (the last is the opacity) for some environments. [plot()]
#'   shows it, [as.raster()] converts it to a raster image.
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
  new_frame(check_frame(answer$tensors$frame))
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

# The frames of an episode, as kept by rollout(frames = TRUE): as PNG files, because a frame of
# CartPole takes 3 MB as numbers and 3 kB as a PNG file.

#' Make the frames of an episode
#' @param files A list of PNG files, each a raw vector.
#' @param fps The number of frames per second, `NULL` if the environment does not say.
#' @return An object of class `gym_frames`, a list whose elements are unpacked by `[[`.
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

# Checks before play whether the environment can be drawn.
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

#' Fetch the current frame as a PNG file
#' @return A raw vector.
#' @noRd
png_frame <- function(client, instance_id, call = rlang::caller_env()) {
  check_png(get_answer(client, paste0(instance_route(instance_id), "render/"), call = call)$png)
}

#' Unpack a frame
#' @return An object of class `gym_frame`, as returned by [env_render()].
#' @noRd
frame_from_png <- function(file) {
  check_suggested("png", "unpack a frame")
  values <- png::readPNG(file)
  shape <- c(dim(values), 1L)[1:3]
  new_frame(array(as.integer(round(255 * values)), shape))
}
