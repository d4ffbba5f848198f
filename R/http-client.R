# A client: the server's address, the connection, the token, and what the server says about itself.

new_client <- function(remote_base, timeout = 60, config = httr::config(), token = NULL) {
  structure(
    list(
      remote_base = sub("/+$", "", remote_base),
      timeout = timeout,
      config = config,
      token = token,
      state = new.env(parent = emptyenv())
    ),
    class = "GymClient"
  )
}

#' @export
print.GymClient <- function(x, ...) {
  print_line(x)
  why <- why_http(x)
  cat("  steps go by ", if (is.null(why)) "a stream" else paste0("HTTP: ", why), "\n", sep = "")
  invisible(x)
}

#' @export
format.GymClient <- function(x, ...) paste0("<GymClient: ", x$remote_base, ">")

check_client <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!inherits(x, "GymClient")) {
    abort_argument(x, "a client, as create_GymClient() or gym_client() makes it", arg, call)
  }
}

# The settings of a client's connection. The session's settings from httr::set_config() come first,
# as in httr's own verbs, then the client's own. For a server on this machine, a proxy of the
# session does not apply.
client_config <- function(client) {
  session <- getOption("httr_config", httr::config())
  if (is_loopback(client$remote_base)) {
    session$options <- session$options[!grepl("^proxy", names(session$options))]
  }
  c(session, client$config)
}

# httr's timeout() replaces the client's `timeout`.
timeout_of <- function(client) {
  configured <- client_config(client)$options$timeout_ms
  if (is.null(configured)) client$timeout else configured / 1000
}

# The part of a client that changes: what it knows about the server and its instances, and `home`,
# its connections. A client in another process, or read from a file, gets a new state, because its
# old connections no longer work and its idempotency keys belong to the original. After
# httr::set_config() or httr::reset_config(), it gets a new `home`.
client_state <- function(client) {
  state <- client$state
  moved <- !identical(state$session, the_session) || state$pid != Sys.getpid()
  if (moved || !identical(state$session_config, getOption("httr_config"))) suspendInterrupts({
    state$home <- new.env(parent = emptyenv())
    state$session_config <- getOption("httr_config")
    if (moved) {
      # All clients of one server in one process share their keys. The server remembers only a
      # limited number of keys, and a script may make a client for each call.
      state$keys <- keys_of_place(client$remote_base)
      state$instances <- new.env(parent = emptyenv())
      state$to_close <- character()
      state$versions <- NULL
      state$described <- new.env(parent = emptyenv())
      # The process in which the client was first used.
      state$made_in <- state$made_in %||% state$pid %||% Sys.getpid()
      state$pid <- Sys.getpid()
      state$session <- the_session
    }
  })
  state
}

# The server recognises a repeated request by its idempotency key: a random text, and a number that
# grows with each request. So all clients and objects of one server, or of one instance, share the
# text and the number. A forked process has its own.
keys_of_place <- function(place) {
  place <- paste(place, Sys.getpid())
  the_session$keys[[place]] %||% (
    the_session$keys[[place]] <- rlang::env(key = random_key(), number = 0)
  )
}

# The idempotency key of the next request.
next_key <- function(keys) {
  keys$number <- keys$number + 1
  list(key = keys$key, number = keys$number)
}

# Unlike R's generator, this never returns the same text twice.
random_key <- function() {
  the_session$key_count <- (the_session$key_count %||% 0) + 1
  rlang::hash(list(
    Sys.info()[["nodename"]], Sys.getpid(), as.numeric(Sys.time()), tempfile(""),
    the_session$key_count
  ))
}

# The versions of the server, its Python and its Gymnasium, a named list. The client asks only once.
# `NULL` without a client, or if there is no answer.
server_versions <- function(client) {
  if (is.null(client)) {
    return(NULL)
  }
  state <- client_state(client)
  state$versions <- state$versions %||%
    tryCatch(get_answer(client, "/v1/health/")$versions, gym_error = function(cnd) NULL)
  state$versions
}

# The token ----------------------------------------------------------------------------------

# A server may require a token. R sends it in one header and shows it nowhere else: not in prints,
# errors or deparsed code.

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
  # Other characters could end the header or start another one. The error must not show the token.
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

# The token of a server that this session starts with these options. The server reads the same file
# or environment variable.
server_token <- function(options, call = rlang::caller_env()) {
  if (!is.null(options$token_file)) {
    as_token(paste(readLines(options$token_file, warn = FALSE), collapse = "\n"), call)
  } else if (!isTRUE(options$no_auth)) {
    variable_token(call)
  }
}

# Whether the options or the variable say which token a server requires, or that it requires none.
says_token <- function(options) {
  !is.null(options$token_file) || isTRUE(options$no_auth) || nzchar(Sys.getenv(token_variable))
}

# The token for an address: that of a server that this session started, otherwise the one in the
# variable.
known_token <- function(base, call = rlang::caller_env()) {
  server <- the_session$servers[[base]]
  if (is.null(server)) variable_token(call) else server$token
}
