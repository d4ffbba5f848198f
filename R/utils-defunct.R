# Functions that have ended. Each stops for one version with an error that names what replaces it.

#' Functions that have ended
#'
#' Calling one of these functions, or making an object of a class that inherits from `GymEnv`, is an
#' error that names what replaces it. The next version does not have them.
#'
#' @param ... Not used.
#' @section Errors: `gym_error_defunct`, whose field `replacement` has the text.
#' @name gym-defunct
#' @aliases GymEnv
#' @export GymEnv
#' @keywords internal
NULL

#' @rdname gym-defunct
#' @export
search_repeat <- function(...) abort_defunct("use `search_random(seeds = )`")

#' @rdname gym-defunct
#' @export
search_landscape <- function(...) {
  abort_defunct("play `policy_candidates()` with weights around the best ones by `rollout()`")
}

GymEnv <- R6Class("GymEnv", public = list(
  initialize = function(...) {
    abort_defunct("give the methods as functions of `self` to `gym_env()`", "The class GymEnv")
  }
))

# The wrappers of environments written in R that a function replaces.
ended_wrappers <- c(
  ClipAction = "TransformAction", RescaleAction = "TransformAction",
  RescaleObservation = "TransformObservation", NormalizeObservation = "TransformObservation",
  ClipReward = "TransformReward", NormalizeReward = "TransformReward"
)

check_wrapper_has_not_ended <- function(wrapper, call) {
  if (wrapper %in% names(ended_wrappers)) {
    abort_defunct(
      paste0("give the function to the wrapper \"", ended_wrappers[[wrapper]], "\""),
      paste0("\"", wrapper, "\" around environments written in R"), call
    )
  }
}

# `what`: what has ended, if not the function itself.
abort_defunct <- function(replacement, what = NULL, call = rlang::caller_env()) {
  what <- what %||% paste0("`", utils::tail(as.character(rlang::error_call(call)[[1L]]), 1L), "()`")
  gym_abort(
    c(paste(what, "has ended."), i = paste0("Instead, ", replacement, ".")),
    class = "gym_error_defunct", replacement = replacement, call = call
  )
}
