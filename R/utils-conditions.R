# All errors of the package are made here, so that each has a class.

gym_abort <- function(message, class = NULL, ..., call = rlang::caller_env(), parent = NULL) {
  rlang::abort(
    # The message may contain text from a server.
    shown_text(message),
    class = c(class, "gym_error"),
    ...,
    call = without_tokens(rlang::error_call(call)),
    trace = hidden_trace(rlang::current_env()),
    parent = parent
  )
}

#' Abort because of an argument
#'
#' @param argument,value Its name and its value.
#' @param ... The lines of the message, with the names of bullets. They are templates of
#'   `cli::format_inline()`, whose `{}` are evaluated where this function is called. A line break is
#'   a space, and a line without text is left out.
#' @noRd
abort_wrong <- function(argument, value, call, ..., .envir = rlang::caller_env()) {
  lines <- gsub("\n *", " ", c(...))
  lines[] <- vapply(lines, cli::format_inline, "", .envir = .envir, keep_whitespace = TRUE)
  gym_abort(
    lines[nzchar(lines)], class = "gym_error_argument", argument = argument, value = value,
    call = call
  )
}

#' Let errors name the call of the function that the user called
#'
#' @param code Calls other functions that users call, too.
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

# Adds a hint to an error that was raised by a function that does not know the reason.
with_hint <- function(cnd, hint) {
  cnd$message <- paste0(cnd$message, "\n", rlang::format_error_bullets(c(i = hint)))
  cnd
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
    class = "gym_error_space",
    space = space,
    value = value,
    path = path,
    call = call
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

# The classes of a user's error, which an error about it keeps, so that users can catch it by them.
own_classes <- function(cnd) {
  setdiff(class(cnd), c("simpleError", "rlang_error", "error", "condition"))
}
