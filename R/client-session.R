# The session's own client, the default of functions with an argument `client`.

#' Use the session's server
#'
#' Return the session's client, the default client of other functions. It uses the server at the
#' address in the environment variable `GYM_SERVER_URL`, with the token in `GYM_SERVER_TOKEN`.
#' Without that variable, the first call starts a server on this machine, which stops with the
#' session. This server accepts calls from this session only, by a secret token (see
#' [gym_server_start()]).
#'
#' @inheritSection gym_server_start If there is no Python
#' @return A client, as returned by [create_GymClient()].
#' @section Errors: `gym_error_server_start` if no server could be started. `gym_error_install` if
#'   its Python environment could not be installed.
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
    the_session$client <- start_server(install = install, call = call)
  }
  the_session$client
}

# One client for all calls, so that they share a connection.
named_client <- function(url, call = rlang::caller_env()) {
  if (!is_server_address(url)) {
    gym_abort(
      paste0("The variable GYM_SERVER_URL must be the address of a server, such as ",
             "\"http://127.0.0.1:5000\", not \"", url, "\"."),
      class = "gym_error_argument",
      call = call
    )
  }
  # The address may be that of a server of this session.
  base <- base_of(url)
  pid <- the_session$servers[[base]]$pid
  names <- list(url, Sys.getenv(token_variable), pid)
  if (!identical(the_session$named_by, names)) {
    the_session$named_client <- new_client(url, token = known_token(base, call))
    the_session$named_by <- names
  }
  the_session$named_client
}

# Whether the session has a server or can start one without installing anything. For the examples in
# the help pages.
can_start_server <- function() {
  tryCatch(
    inherits(session_client(install = FALSE), "GymClient"),
    gym_error_server_start = function(cnd) FALSE
  )
}
