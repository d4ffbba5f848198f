#' Record an environment's episodes
#'
#' From the next reset on, the server writes a row for each finished episode into a table,
#' `episodes.csv`: its number, return, length in steps and seconds. It records videos of the
#' episodes that `video_callable` selects. `env_monitor_close()`, or closing the environment, ends
#' the monitor and finishes its files. Without a monitor it does nothing.
#'
#' @section Files: A monitor has its own directory, with the table, `episodes.csv`, and videos named
#'   by the number of their episode, such as `rl-video-episode-0.mp4`. If another monitor, of this
#'   server or another one, writes in `directory`, the new one uses a directory below it with the
#'   name of the `instance_id`, such as `1a2b3c4d`.
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
#' @param resume Continue the numbering of an earlier monitor? This is the one of this instance if
#'   it has a directory below, otherwise the first one. The default is `FALSE`, which refuses a
#'   directory with the files of an earlier monitor.
#' @param video_callable Which episodes to record as videos: `FALSE`, the default, for none, `TRUE`
#'   for all, or a whole number n for every n-th, starting with the first. Requires the server's
#'   extra `video` (the Python package moviepy). The server keeps the frames of an episode in memory
#'   until it ends: a thousand frames of CartPole are 720 MB.
#' @return Nothing, invisibly.
#' @section Errors: `gym_error_http_400` for an unknown instance, a directory that is refused, a
#'   monitor that is already active, or videos that cannot be made, with the reason. If something
#'   could not be recorded, the environment goes on, and closing either raises the error.
#'   `gym_error_argument`; `gym_error_connection`.
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
  if (!isTRUE(video_callable) && !isFALSE(video_callable)) {
    check_count(video_callable, min = 1)
  }
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
