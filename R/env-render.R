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
  cat("<gym_frame: ", ncol(x), " x ", nrow(x), " pixels>\n", sep = "")
  invisible(x)
}
