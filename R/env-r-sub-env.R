# A sub-environment written in R: its functions and its state. A single environment has one of
# these; a vectorised one has all its sub-environments in one.

#' Make a sub-environment
#'
#' @param reset A function of `seed` and `options` that returns the first observation.
#' @param step A function of an action, like the user's `step()`.
#' @param render A function without arguments that draws it, or `NULL`.
#' @param takes_options Whether the user's `reset()` accepts options.
#' @param num_envs `NULL`, or the number of sub-environments of a vectorised one.
#' @return An environment: these, and `generator`, its random generator, `NULL` before first use;
#'   `taken`, the number of steps in the episode, `NA` before the first reset; `ended`, whether it
#'   has ended, `NA` after the warning; `closed`.
#' @noRd
new_sub_env <- function(traits, reset, step, render = NULL, takes_options = FALSE,
                        num_envs = NULL) {
  sub_env <- new.env(parent = emptyenv())
  sub_env$traits <- traits
  sub_env$reset <- reset
  sub_env$step <- step
  sub_env$render <- render
  sub_env$takes_options <- takes_options
  sub_env$num_envs <- num_envs
  sub_env$generator <- NULL
  sub_env$taken <- NA_integer_
  sub_env$ended <- FALSE
  sub_env$closed <- FALSE
  sub_env
}

#' Convert integer64 in the results of a user's functions to plain numbers
#' @param functions A list of `reset` and `step`.
#' @noRd
plain_results <- function(functions) {
  reset <- functions$reset
  step <- functions$step
  functions$reset <- function(seed, options) narrow_values(reset(seed, options))
  functions$step <- function(action) plain_step(step(action))
  functions
}

#' Start an episode
#'
#' @param seed The seed of its generator; `NULL` continues the generator. An environment that was
#'   never seeded draws a seed from the session's generator.
#' @return The first observation, checked: one, or a batch for a vectorised environment.
#' @noRd
reset_sub_env <- function(sub_env, seed = NULL, options = NULL, sub_env_number = NULL,
                          call = rlang::caller_env()) {
  if (!is.null(options) && !sub_env$takes_options) {
    gym_abort(
      c(paste0("`reset()` of ", sub_env$traits$spec$id, " does not accept options."),
        i = "Give it an argument `options` to accept them."),
      class = "gym_error_argument", argument = "options", value = options, call = call
    )
  }
  if (!is.null(seed)) {
    sub_env$generator <- new_generator(seed)
  } else if (is.null(sub_env$generator)) {
    sub_env$generator <- new_generator(draw_seed())
  }
  sub_env$taken <- NA_integer_
  observation <- withCallingHandlers(
    with_generator(sub_env$generator, sub_env$reset(seed, options)),
    error = function(cnd) abort_raised(cnd, sub_env, sub_env_number, call)
  )
  where <- paste0("`reset()` of ", sub_env$traits$spec$id)
  observation <- checked_observation(sub_env$traits, observation, sub_env$num_envs, where, call)
  sub_env$taken <- 0L
  sub_env$ended <- logical(sub_env$num_envs %||% 1L)
  observation
}

#' Take a step
#'
#' @param action One checked action, or a batch of them for a vectorised environment.
#' @return The result of the user's `step()`, unchecked.
#' @noRd
raw_step <- function(sub_env, action, call) {
  out <- withCallingHandlers(
    with_generator(sub_env$generator, sub_env$step(action)),
    error = function(cnd) abort_raised(cnd, sub_env, NULL, call)
  )
  sub_env$taken <- sub_env$taken + 1L
  out
}

check_was_reset <- function(sub_env, call) {
  if (is.na(sub_env$taken)) {
    gym_abort(
      c(paste0(sub_env$traits$spec$id, " has not been reset."),
        i = "`env$reset()` starts an episode."),
      class = "gym_error_argument", argument = "env", call = call
    )
  }
}

#' Report an error in the user's function, with its place
#'
#' @param method Which of the user's functions raised it.
#' @noRd
abort_raised <- function(cnd, sub_env, sub_env_number, call,
                         method = if (is.na(sub_env$taken)) "reset" else "step") {
  # A wrapper's error already says what went wrong.
  if (inherits(cnd, "gym_error_wrapper")) return(invisible())
  id <- sub_env$traits$spec$id
  step <- if (method == "step") sub_env$taken + 1L
  at <- if (!is.null(step)) paste0(" in step ", step, " of the episode")
  in_sub_env <- if (!is.null(sub_env_number)) paste0(" (sub-environment ", sub_env_number, ")")
  gym_abort(
    paste0("`", method, "()` of ", id, " raised an error", at, in_sub_env, "."),
    class = c(own_classes(cnd), "gym_error_environment"),
    env_id = id, step = step, sub_env = sub_env_number, call = call, parent = cnd
  )
}
