# Functions that have ended. Each stops for one version with an error that names what replaces it.

#' Functions that have ended
#'
#' Calling one of these functions is an error that names what replaces it. The next version does not
#' have them.
#'
#' @param ... Not used.
#' @section Errors: `gym_error_defunct`, whose field `replacement` has the text.
#' @name gym-defunct
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

# `what`: what has ended, if not the function itself.
abort_defunct <- function(replacement, what = NULL, call = rlang::caller_env()) {
  name <- as.character(rlang::error_call(call)[[1L]])
  what <- what %||% paste0("`", name[length(name)], "()`")
  gym_abort(
    c(paste(what, "has ended."), i = paste0("Instead, ", replacement, ".")),
    class = "gym_error_defunct", replacement = replacement, call = call
  )
}
