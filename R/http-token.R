# The token that a server asks for. It goes into one header and nowhere else: nothing that is
# printed, kept of an error or deparsed shows it.

#' Keep a token where nobody sees it by accident
#' @param text The token, a string, or `NULL`.
#' @return A function of no arguments that returns it, or `NULL`: what prints, formats or deparses
#'   a function shows its code.
#' @noRd
new_token <- function(text) {
  if (is.null(text)) {
    return(NULL)
  }
  force(text)
  structure(function() text, class = "gym_token")
}

#' @export
print.gym_token <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

#' @export
format.gym_token <- function(x, ...) "<token>"

token_variable <- "GYM_SERVER_TOKEN"

#' Check a token as a script gives it
#' @param token A string; `NULL` and `""` are none.
#' @return As [new_token()] returns it.
#' @noRd
as_token <- function(token, call = rlang::caller_env()) {
  hide_token(token)
  if (is.null(token) || identical(token, "")) {
    return(NULL)
  }
  token <- if (rlang::is_string(token)) trimws(token)
  # What else there may be would end the header, or begin another.
  if (is.null(token) || !grepl("^[!-~]+$", token)) {
    gym_abort(
      c(
        "`token` must be one string of visible ASCII characters.",
        i = paste0("Without `token` it is what the environment variable ", token_variable,
                   " holds.")
      ),
      class = "gym_error_argument", argument = "token", call = call
    )
  }
  hide_token(token)
  new_token(token)
}

# The token that the session's environment has for its servers.
variable_token <- function(call = rlang::caller_env()) as_token(Sys.getenv(token_variable), call)

# That of a server which this session started with these options: the server reads the same file
# and sees the same variable.
server_token <- function(options, call = rlang::caller_env()) {
  if (!is.null(options$token_file)) {
    as_token(paste(readLines(options$token_file, warn = FALSE), collapse = "\n"), call)
  } else if (!isTRUE(options$no_auth)) {
    variable_token(call)
  }
}

# The token for an address of this session's: a server that it started, or a named one.
known_token <- function(base) {
  server <- the_session$servers[[base]]
  if (is.null(server)) variable_token() else server$token
}
