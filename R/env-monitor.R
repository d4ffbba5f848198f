#' Record an environment's episodes
#'
#' From the next reset on the server writes one row for each finished episode
#' into a table, `episodes.csv`: its number, return, length in steps and seconds.
#' Videos are recorded where `video_callable` asks for them. `env_monitor_close()`,
#' or closing the environment, ends the monitor and finishes its files; where there
#' is no monitor it does nothing.
#'
#' @section Files: A monitor has a directory of its own, with the table, `episodes.csv`, and
#'   videos with the number of their episode, `rl-video-episode-0.mp4`. When another monitor
#'   writes in `directory`, of this server or of another one, that is a directory below it with
#'   the name of the `instance_id`, such as `1a2b3c4d`.
#'   `list.files(directory, "^episodes[.]csv$", recursive = TRUE)` finds all tables.
#' @inheritParams env_reset
#' @param directory Where the server writes, a string: a path below the server's
#'   directory for monitors (its option `--monitor-dir`), or, for a server on
#'   this machine, below the system's directory for temporary files. A server
#'   started from R without `monitor_dir` has a new temporary directory for relative
#'   paths: name an absolute one, such as `file.path(tempdir(), "runs")`, or start it
#'   by `gym_server_start(monitor_dir = "runs")`.
#' @param force Whether to delete what monitors have left in the directory that are gone:
#'   closed, or ended with their server. Files of monitors that still write, and all other
#'   files, are never touched. Default `FALSE`.
#' @param resume Whether to go on counting where an earlier monitor stopped: this
#'   instance's, where it has a directory below, else the first one's. Default `FALSE`: a
#'   directory with the files of a monitor that is gone is refused.
#' @param video_callable Which episodes to record as videos: `FALSE`, the
#'   default, for none, `TRUE` for each, or a whole number n for every n-th,
#'   beginning with the first. Needs the server's extra `video` (the Python
#'   package moviepy).
#' @return Nothing, invisibly.
#' @section Errors: `gym_error_http_400` for an unknown instance, a directory
#'   that is refused, a monitor that is active already, or videos that cannot be made, with
#'   the reason; `gym_error_http_429` when all monitors together have written as much as the server
#'   allows (`max_monitor_mb` of [gym_server_start()]): a monitor stops recording then, the
#'   environment goes on, and closing either raises the error; `gym_error_argument`;
#'   `gym_error_connection`.
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
  post_answer(x, paste0(instance_route(instance_id), "monitor/close/"))
  invisible()
}
