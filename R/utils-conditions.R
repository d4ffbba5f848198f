# All errors of the package are made here, so that each has a class.

gym_abort <- function(message, class = NULL, ..., call = rlang::caller_env(), parent = NULL) {
  frame <- rlang::current_env()
  rlang::abort(
    # The message may contain text from a server.
    shown_text(message),
    class = c(class, "gym_error"), ..., call = without_tokens(rlang::error_call(call)),
    # With NULL, rlang makes the trace itself. That is enough if no token is known.
    trace = if (length(the_session$hidden)) {
      trace <- rlang::trace_back(bottom = frame)
      trace$call <- lapply(trace$call, without_tokens)
      trace
    },
    parent = parent
  )
}

#' Raise an error about an argument
#'
#' @param argument,value Its name and its value.
#' @param call The frame of the function that the user has called.
#' @param ... The lines of the message, named by their bullets. Lines without text are left out. A
#'   string in the call, also in a branch of `if`, is a template as in [cli::pluralize()]: `{x}` is
#'   the value of R code, and a line break is a space. The result of any other code is shown as it
#'   is, because a user or a server may have written braces in it.
#' @param frame Where this code is evaluated.
#' @noRd
abort_wrong <- function(argument, value, call, ..., class = "gym_error_argument",
                        frame = rlang::caller_env()) {
  force(frame)
  fill <- function(part) {
    if (is.call(part) && identical(part[[1L]], quote(`if`))) {
      chosen <- if (eval(part[[2L]], frame)) 3L else 4L
      if (chosen <= length(part)) fill(part[[chosen]])
    } else if (is.call(part) && identical(part[[1L]], quote(`{`))) {
      fill(part[[length(part)]])
    } else if (is.character(part)) {
      # pluralize() needs glue, which cli only suggests.
      text <- gsub("\\s*\n\\s*", " ", part)
      as.character(cli::pluralize(text, .envir = frame, .transformer = glue::identity_transformer))
    } else {
      eval(part, frame)
    }
  }
  lines <- unlist(lapply(as.list(substitute(list(...)))[-1L], fill))
  gym_abort(lines[nzchar(lines)], class = class, argument = argument, value = value, call = call)
}

# The other arguments are evaluated only if there is a problem.
abort_if <- function(problem, argument, value, call, ..., frame = rlang::caller_env()) {
  if (problem) abort_wrong(argument, value, call, ..., frame = frame)
}

#' Let errors name the call of the function that the user called
#'
#' @param code Code that calls other functions which users can also call.
#' @param of The names of these functions, strings.
#' @param call The frame of the function that the user has called.
#' @noRd
naming_own_call <- function(code, of, call = rlang::caller_env()) {
  own <- without_tokens(rlang::error_call(call))
  rename <- function(cnd) {
    if (is.call(cnd$call) && is.symbol(cnd$call[[1L]]) && as.character(cnd$call[[1L]]) %in% of) {
      cnd["call"] <- list(own)
    }
    if (!is.null(cnd$parent)) cnd$parent <- rename(cnd$parent)
    cnd
  }
  withCallingHandlers(code, gym_error = function(cnd) rlang::cnd_signal(rename(cnd)))
}

# `path` is the place of the wrong part in the whole value; it is "" for the whole.
abort_space <- function(space, value, problem, call, path = "") {
  place <- if (nzchar(path)) paste0("At `", if (!startsWith(path, "$")) "$", path, "`: the")
  found <- if (is.data.frame(value)) {
    paste(if (is.null(place)) "A" else sub("the$", "a", place), "data frame with",
          count_of(nrow(value), "row"), "and", count_of(ncol(value), "column"))
  } else {
    paste(place %||% "The", "value", describe_value(value))
  }
  gym_abort(
    c(paste0(problem, "."), x = paste0(found, " does not fit the space ", format(space), "."),
      i = integer64_hint(value)),
    class = "gym_error_space", space = space, value = value, path = path, call = call
  )
}

describe_value <- function(value) {
  if (is.factor(value)) {
    return(paste("the factor", describe_value(as.character(value))))
  }
  if (is_integer64(value)) {
    # deparse() would show its bits as a double.
    return("of class integer64")
  }
  if (is.atomic(value) && length(value) == 1L && is.na(value) && !is.nan(value)) {
    return("NA")
  }
  text <- paste(deparse(value, width.cutoff = 60L, nlines = 3L), collapse = " ")
  if (nchar(text) > 80L) paste0(substr(text, 1L, 77L), "...") else text
}

# Returns the own classes of a user's error. Our error about it keeps them, so that users can catch
# it by them.
own_classes <- function(cnd) {
  setdiff(class(cnd), c("simpleError", "rlang_error", "error", "condition"))
}

# Functions that no longer exist ------------------------------------------------------------
# For one version, each of these raises an error that names what replaces it.

#' Functions that no longer exist
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

# `what`: what has ended, if not the function itself.
abort_defunct <- function(replacement, what = NULL, call = rlang::caller_env()) {
  what <- what %||% paste0("`", utils::tail(as.character(rlang::error_call(call)[[1L]]), 1L), "()`")
  gym_abort(
    c(paste(what, "has ended."), i = paste0("Instead, ", replacement, ".")),
    class = "gym_error_defunct", replacement = replacement, call = call
  )
}
