# A client: the server's address, its connection, and what the server says about itself.

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

# The settings of a client's connection: those made by httr::set_config() for the session, as for
# httr's own verbs, and then its own. A proxy of the session does not apply to a server on this
# machine.
client_config <- function(client) {
  session <- getOption("httr_config", httr::config())
  if (is_loopback(client$remote_base)) {
    session$options <- session$options[!grepl("^proxy", names(session$options))]
  }
  c(session, client$config)
}

# The server's description of itself, a named list; `NULL` without such a route or without a client.
# It is requested once.
server_health <- function(client, call = rlang::caller_env()) {
  if (is.null(client)) {
    return(NULL)
  }
  state <- client_state(client)
  if (is.null(state$health)) {
    state$health <- list(tryCatch(
      get_answer(client, "/v1/health/", call = call), gym_error_http = function(cnd) NULL
    ))
  }
  state$health[[1L]]
}

# The versions of the server, its Python and its Gymnasium, a named list or `NULL`.
server_versions <- function(client) {
  tryCatch(server_health(client)$versions, gym_error = function(cnd) NULL)
}

# Whether the server plays whole episodes itself. Older ones do not.
plays_rollouts <- function(client, call = rlang::caller_env()) {
  isTRUE(server_health(client, call)$rollouts)
}
