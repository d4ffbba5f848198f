# Every error of the package is made here, so that each has a class.

gym_abort <- function(message, class = NULL, ..., call = rlang::caller_env(), parent = NULL) {
  rlang::abort(
    message,
    class = c(class, "gym_error"),
    ...,
    call = call,
    parent = parent,
    use_cli_format = TRUE
  )
}

abort_http <- function(status, problem, request, call) {
  status_text <- httr::http_status(status)$reason
  gym_abort(
    c(
      sentence(problem$message %||% "The server gave no reason"),
      i = sentence(problem$hint),
      " " = paste0(request, " [", status, " ", status_text, "]")
    ),
    class = c(
      if (identical(problem$code, "action_not_in_space")) "gym_error_space",
      paste0("gym_error_http_", status),
      "gym_error_http"
    ),
    status = status,
    code = problem$code,
    hint = problem$hint,
    call = call
  )
}

# The server's words begin in lower case and have no full stop, to stand anywhere.
sentence <- function(text) {
  if (is.null(text)) {
    return(NULL)
  }
  text <- paste0(toupper(substr(text, 1L, 1L)), substring(text, 2L))
  if (grepl("[.?!]$", text)) text else paste0(text, ".")
}

abort_connection <- function(base, reason, call) {
  gym_abort(
    c(
      paste0("No answer from the server at ", base, "."),
      x = reason,
      i = "Is a server running there? `gym_server_start()` starts one on this machine."
    ),
    class = "gym_error_connection",
    url = base,
    call = call
  )
}

abort_space <- function(space, value, problem, call) {
  gym_abort(
    c(
      paste0(problem, "."),
      x = paste0("The value ", describe_value(value), " does not fit the space ",
                 format(space), ".")
    ),
    class = "gym_error_space",
    space = space,
    value = value,
    call = call
  )
}

describe_value <- function(value) {
  text <- paste(deparse(value, width.cutoff = 60L), collapse = " ")
  if (nchar(text) > 80L) paste0(substr(text, 1L, 77L), "...") else text
}
