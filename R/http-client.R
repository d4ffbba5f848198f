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

# httr's timeout() takes precedence over the client's own.
timeout_of <- function(client) {
  configured <- client_config(client)$options$timeout_ms
  if (is.null(configured)) client$timeout else configured / 1000
}

# The part of a client besides its address: what it knows of the server and of its instances, and
# `home`, its connections. It is made again if the client is in another process or restored from a
# file: connections are then void, and its idempotency keys belong to the original. `home` is also
# made again after httr::set_config() or httr::reset_config().
client_state <- function(client) {
  state <- client$state
  if (!identical(state$session, the_session) || state$pid != Sys.getpid()) {
    suspendInterrupts({
      # All clients of one server in one process share their keys: the server remembers a limited
      # number for an instance, and a script may make a client for each call.
      state$keys <- keys_of_place(client$remote_base)
      state$home <- new.env(parent = emptyenv())
      state$session_config <- getOption("httr_config")
      state$instances <- new.env(parent = emptyenv())
      state$to_close <- character()
      state$versions <- NULL
      state$described <- new.env(parent = emptyenv())
      # The process in which the client was first used.
      state$made_in <- state$made_in %||% state$pid %||% Sys.getpid()
      state$pid <- Sys.getpid()
      state$session <- the_session
    })
  } else if (!identical(state$session_config, getOption("httr_config"))) {
    suspendInterrupts({
      state$home <- new.env(parent = emptyenv())
      state$session_config <- getOption("httr_config")
    })
  }
  state
}

# The idempotency keys by which the server recognises a repeated request: a random text, and the
# number of the last request. All clients and objects of one server, or of one instance, share
# them, because numbers must grow. A forked process has others.
keys_of_place <- function(place) {
  place <- paste(place, Sys.getpid())
  the_session$keys[[place]] %||% (
    the_session$keys[[place]] <- rlang::env(key = random_key(), number = 0)
  )
}

# The idempotency key of the next request, for its field `request`.
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

# The versions of the server, its Python and its Gymnasium, a named list: requested once. `NULL`
# without a client, or if there is no answer.
server_versions <- function(client) {
  if (is.null(client)) {
    return(NULL)
  }
  state <- client_state(client)
  state$versions <- state$versions %||%
    tryCatch(get_answer(client, "/v1/health/")$versions, gym_error = function(cnd) NULL)
  state$versions
}
