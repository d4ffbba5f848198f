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
  if (is.null(instance$shown)) {
    open_watch(instance, call)
  }
}

open_watch <- function(instance, call = rlang::caller_env()) {
  viewer <- check_viewer(call)
  address <- paste0(
    instance$client$remote_base, instance$route, "watch/", watch_key(instance, call)
  )
  # Set this first, so that a viewer that fails does so only once.
  instance$shown <- TRUE
  comes <- open_address(address, viewer) && await_watcher(instance)
  if (!comes && !isFALSE(viewer)) {
    rlang::inform(
      paste0("Watch ", instance$spec$id, " at ", address), class = "gym_message_watch"
    )
  }
  invisible(address)
}

# A browser sends no token. If the server requires one, the link has a key instead.
watch_key <- function(instance, call) {
  key <- post_answer(instance$client, paste0(instance$route, "watch/key/"), call = call)$key
  if (!is.null(key) && !(rlang::is_string(key) && grepl("^[A-Za-z0-9_-]{1,200}$", key))) {
    refuse_field(key, "key", "a string of letters and digits")
  }
  if (!is.null(key)) paste0("?key=", key)
}

#' Wait until somebody watches
#'
#' A browser takes a moment to start; a fast environment would be finished before that.
#' @return Whether somebody watches, logical: opening a browser may fail without an error.
#' @noRd
await_watcher <- function(instance) {
  deadline <- now() + watcher_timeout
  repeat {
    if (isTRUE(get_answer(instance$client, instance$route)$watched)) {
      return(TRUE)
    }
    if (now() >= deadline) {
      return(FALSE)
    }
    Sys.sleep(0.1)
  }
}

# In seconds.
watcher_timeout <- 5
