# The spaces of an environment that is named by its id.

#' Find out the spaces of an environment
#'
#' An environment that is named by its id is made for the question, and closed.
#' @return A list: `observation_space` and `action_space`, those of a single sub-environment where
#'   there are several, and `spec`.
#' @noRd
known_spaces <- function(env, client, call = rlang::caller_env()) {
  check_environment(env, call = call)
  if (is.character(env) || inherits(env, "gym_wrapped")) {
    env <- gym_make(env, client = client)
    on.exit(close_quietly(env))
  }
  list(
    observation_space = env$single_observation_space %||% env$observation_space,
    action_space = env$single_action_space %||% env$action_space,
    spec = env$spec
  )
}

# An environment that was made for a question: an error on the way says more than one from closing.
close_quietly <- function(env) tryCatch(env$close(), gym_error = function(cnd) NULL)

check_environment <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  named <- rlang::is_string(x) && !is.na(x) && nzchar(x)
  if (!named && !is_playable(x) && !inherits(x, "gym_wrapped")) {
    must <- "the id of an environment or an environment made by `gym_make()`"
    abort_argument(x, must, arg, call)
  }
  invisible(x)
}

is_playable <- function(x) {
  (is.environment(x) || is.list(x)) && is.function(x$reset) && is.function(x$step)
}
