# The token that a server requires. It is sent in one header and appears nowhere else: it is not
# printed, and not kept in errors or deparsed code.

#' Hide a token from accidental display
#' @param text The token, a string, or `NULL`.
#' @return A function without arguments that returns the token, or `NULL`. Printing, formatting or
#'   deparsing a function shows only its code.
#' @noRd
new_token <- function(text) {
  if (is.null(text)) {
    return(NULL)
  }
  force(text)
  structure(function() text, class = "gym_token")
}

#' @export
print.gym_token <- function(x, ...) print_line(x)

#' @export
format.gym_token <- function(x, ...) "<token>"

token_variable <- "GYM_SERVER_TOKEN"

#' Check a token given by a script
#' @param token A string; `NULL` and `""` mean no token.
#' @return As [new_token()].
#' @noRd
as_token <- function(token, call = rlang::caller_env()) {
  hide_token(token)
  if (is.null(token) || identical(token, "")) {
    return(NULL)
  }
  token <- if (rlang::is_string(token)) trimws(token)
  # Other characters could end the header or start another one. The error must not have the token.
  abort_if(
    is.null(token) || !grepl("^[!-~]+$", token), "token", NULL, call,
    "`token` must be one string of visible ASCII characters.",
    i = "Without `token` it is what the environment variable {token_variable} holds."
  )
  hide_token(token)
  new_token(token)
}

# The token in the environment variable.
variable_token <- function(call = rlang::caller_env()) as_token(Sys.getenv(token_variable), call)

# The token of a server that this session started with these options: the server reads the same
# file, or the same environment variable.
server_token <- function(options, call = rlang::caller_env()) {
  if (!is.null(options$token_file)) {
    as_token(paste(readLines(options$token_file, warn = FALSE), collapse = "\n"), call)
  } else if (!isTRUE(options$no_auth)) {
    variable_token(call)
  }
}

# Whether options, or the variable, set a server's token, or that it requires none.
says_token <- function(options) {
  !is.null(options$token_file) || isTRUE(options$no_auth) || nzchar(Sys.getenv(token_variable))
}

# The token for an address: that of a server started by this session, otherwise the variable's.
known_token <- function(base, call = rlang::caller_env()) {
  server <- the_session$servers[[base]]
  if (is.null(server)) variable_token(call) else server$token
}
