# The session's own client, which functions take that are given none.

#' Use the session's server
#'
#' Returns the client that functions take when they are given none. It talks to
#' the server that the environment variable `GYM_SERVER_URL` names or, without
#' it, to one on this machine, which is started at the first call and stops with
#' the session. That one takes calls from this session alone, by a token that nobody else knows (see
#' [gym_server_start()]); a server that `GYM_SERVER_URL` names is sent the token that
#' `GYM_SERVER_TOKEN` holds.
#'
#' @inheritSection gym_server_start Where there is no Python
#' @return A client, as [create_GymClient()] makes it.
#' @section Errors: `gym_error_server_start` when no server could be started;
#'   `gym_error_install` when a Python environment was to be installed first, and could not be.
#' @export
#' @examplesIf gym:::can_start_server()
#' gym_client()
gym_client <- function() {
  session_client()
}

# `install` as start_server() takes it.
session_client <- function(install = TRUE, call = rlang::caller_env()) {
  url <- Sys.getenv("GYM_SERVER_URL")
  if (nzchar(url)) {
    return(named_client(url, call))
  }
  if (is.null(the_session$client) || !is_running(the_session$client$remote_base)) {
    options <- as.list(the_session$server_options)
    the_session$client <- start_server(options = options, install = install, call = call)
  }
  the_session$client
}

# One client for all calls, so that they share its connection.
named_client <- function(url, call = rlang::caller_env()) {
  if (!grepl("^https?://[^/]", url)) {
    gym_abort(
      paste0("The variable GYM_SERVER_URL must be the address of a server, such as ",
             "\"http://127.0.0.1:5000\", not \"", url, "\"."),
      class = "gym_error_argument",
      call = call
    )
  }
  # It may be the address of a server that this session runs.
  base <- base_of(url)
  pid <- the_session$servers[[base]]$pid
  names <- list(url, Sys.getenv(token_variable), pid)
  if (!identical(the_session$named_by, names)) {
    the_session$named_client <- new_client(url, token = known_token(base, call))
    the_session$named_by <- names
  }
  the_session$named_client
}

# Whether the session has a server or can start one without installing anything. The examples of
# the help pages ask.
can_start_server <- function() {
  tryCatch(
    inherits(session_client(install = FALSE), "GymClient"),
    gym_error_server_start = function(cnd) FALSE
  )
}
