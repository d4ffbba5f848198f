# The page on which a server shows an environment, and how users open it.

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
#' `options(gym.viewer = )` changes this, in scripts too: a function, such as [utils::browseURL()],
#' is called with the address, and `FALSE` opens and shows nothing. If the server requires a token,
#' the address contains a key for this page only.
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
  # Set this first, so that a viewer that fails does so only once.
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
