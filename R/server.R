# Local servers, which start and end with this session. A server ends when its standard input
# closes. That happens however the R session ends.

# A forked child uses its parent's server and cannot ask its process whether it runs.
is_running <- function(base) {
  server <- the_session$servers[[base]]
  !is.null(server) && (Sys.getpid() != the_session$pid || server$process$is_alive())
}

#' Start a server on this machine
#'
#' Start the server that comes with the package, as a process of its own, and wait until it accepts
#' connections. It stops with the R session, even if the session is killed.
#'
#' The server runs with the first suitable Python in this order: `python`; the environment variable
#' `GYM_PYTHON`; an active virtual environment (`VIRTUAL_ENV`, `CONDA_PREFIX`); the environment made
#' by [gym_server_install()]; the `PATH`. If you set `python` or `GYM_PYTHON`, no other Python is
#' tried. [gym_sitrep()] shows the result.
#'
#' @section If there is no Python:
#' If no Python can run the server, an interactive session asks once whether to install one by
#' [gym_server_install()], and then continues with the call. A script stops with an error or, with
#' the environment variable `GYM_INSTALL=1`, installs it without asking. Nothing is installed if you
#' set `python` or `GYM_PYTHON`.
#' @param port The port to listen on, a whole number. `NULL`, the default, uses a free one.
#' @param python Path of a Python 3.10 or newer, a string, or `NULL`.
#' @param ... Further options of the server, by name: `monitor_dir = "runs"` means
#'   `--monitor-dir runs`.
#'   * `allow_module = c("a", "b")` names Python modules whose environments may be made.
#'   * `token_file = "token"` names a file with a token of 16 characters or more, which replaces the
#'   server's own one.
#'   * Limits (with their defaults): `max_processes` (of environments, 128; besides these as many
#'   play whole episodes, but no more than one per core) and `max_memory_mb` (of the server's
#'   process, and of each of its processes, on Linux; three quarters of the machine's).
#'   * `max_call_seconds` is the time after which a call that hangs ends the server, or the worker
#'   process in which it hangs (300; 0 for no limit). `idle_minutes` is the time after which an
#'   unused environment is removed (1,440; 0 for never).
#'   * `vignette("server", package = "gym")` describes the options of a server that others reach:
#'   `allow_host`, `no_auth`.
#' @param timeout The time for the start, in seconds. The default is 60.
#' @param token Should the server require its own token? `TRUE` or `FALSE`. Only this session knows
#'   it, so other accounts of the machine cannot use the server. The returned client carries the
#'   token, and so does each client that [create_GymClient()] makes for this address in this
#'   session.
#'   Other processes, such as another R session or clients in other languages, need `FALSE` or a
#'   token that they know. The default is `TRUE` without `port`, and `FALSE` with one, because
#'   scripts name that address. Any account of the machine can then use the server, as a message of
#'   class `gym_message_open_server` says. `token_file`, `no_auth = TRUE` and the environment
#'   variable `GYM_SERVER_TOKEN` take precedence.
#' @param users Path of a file with a name and a token on each line, a string, or `NULL`. With it
#'   each user gets a server of their own, as described in `vignette("server", package = "gym")`:
#'   nobody can see, step or close what another has. The file must be readable by you alone, and is
#'   read again when it changes. Not available on Windows.
#' @return A client for the server, as returned by [create_GymClient()]. With `users` it has the
#'   token of `GYM_SERVER_TOKEN`, or none; users call [create_GymClient()] with their own.
#' @section Errors: `gym_error_server_start`, with the server's own message, if no Python can run
#'   it, the port is taken or the start takes too long. `gym_error_install` if a Python environment
#'   could not be installed. `gym_error_argument`.
#' @seealso [gym_server_stop()], [gym_server_log()], [gym_client()]
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' env_list_all(server)
#' gym_server_stop(server)
gym_server_start <- function(port = NULL, python = NULL, ..., timeout = 60,
                             token = is.null(port) && is.null(users), users = NULL) {
  # Evaluate the token first: any later error would show the call with it.
  hide_token(token)
  if (!rlang::is_bool(token)) {
    abort_wrong("token", NULL, rlang::current_env(), "`token` must be `TRUE` or `FALSE`.",
                i = "Set your own token in a file, by `token_file = `, or in the environment
                     variable {token_variable}.")
  }
  check_count(port, min = 0, max = 65535, allow_null = TRUE)
  check_string(python, allow_null = TRUE)
  check_number(timeout, min = 0.001)
  check_string(users, allow_null = TRUE)
  if (token && !is.null(users)) {
    abort_wrong("token", NULL, rlang::current_env(),
                "`token = TRUE` and `users` exclude each other: `users` has a token for each
                 user.")
  }
  options <- c(list(...), if (!is.null(users)) list(users = users))
  client <- start_server(port, python, options, timeout, token)
  if (missing(token) && is.null(client$token) && !isTRUE(options$no_auth) && is.null(users)) {
    cli::cli_inform(
      c(i = paste("The server at {client$remote_base} requires no token: any account of this",
                  "machine can use it.")),
      class = "gym_message_open_server"
    )
  }
  client
}

#' Start a server with the first Python that can run it
#' @param token Should it require its own token, unless there is another one?
#' @param install May a Python environment be installed (after a question, or by `GYM_INSTALL`) if
#'   no Python can run the server?
#' @return A client for the server.
#' @noRd
start_server <- function(port = NULL, python = NULL, options = list(), timeout = 60, token = TRUE,
                         install = TRUE, call = rlang::caller_env()) {
  paths <- Filter(rlang::is_string, options[names(options) %in% c("token_file", "users")])
  options[names(paths)] <- lapply(paths, path.expand)
  arguments <- c(
    "-c", run_server, "--stop-on-stdin-eof", "--port", sprintf("%.0f", port %||% 0),
    server_options(options, call)
  )
  own_token <- if (token && !says_token(options)) new_token(hex(openssl::rand_bytes(32L)))
  refusals <- character()
  # Launches the server with the first Python that can run it, or returns NULL.
  launch_with_first <- function(pythons) {
    for (candidate in pythons) {
      server <- launch_server(candidate, arguments, timeout, own_token, call)
      if (is.list(server)) {
        server$token <- own_token %||% server_token(options, call)
        return(register_server(server))
      }
      refusals[[candidate]] <<- server
    }
  }
  launch_with_first(python_candidates(python)) %||%
    (if (install && is.null(named_python(python))) launch_with_first(prompt_for_python())) %||%
    abort_no_python(python, refusals, call)
}

register_server <- function(server) {
  # How to install an extra, if the server runs in the environment of gym_server_install(). It is
  # NULL for a server with another Python, which somebody else maintains.
  server$extra_hint <- function(extra) {
    if (is_installed_python(server$python)) {
      paste0("`gym_server_install(extras = \"", extra, "\")` installs it, and this server finds it")
    }
  }
  server$why_ended <- function() end_reason(server$process, server$log)
  the_session$servers[[server$url]] <- server
  # At the session's end R runs the youngest finalizer first. This one is registered after the
  # process was started, so it runs before processx's: the process can still be asked to end. The
  # list protects the object from garbage collection, which would run its finalizer early.
  ending <- new.env(parent = emptyenv())
  reg.finalizer(ending, function(ending) end_session(the_session), onexit = TRUE)
  the_session$endings <- c(the_session$endings, ending)
  new_client(server$url, token = server$token)
}

# Options as a command line: monitor_dir = "runs" becomes --monitor-dir runs, TRUE a flag, and a
# vector one option for each element.
server_options <- function(options, call = rlang::caller_env()) {
  check_dots_named(options, "monitor_dir = \"runs\"", call = call)
  flags <- paste0("--", gsub("_", "-", names(options)))
  texts <- function(flag, values) {
    if (isTRUE(values)) {
      flag
    } else if (length(values) && !isFALSE(values)) {
      as.vector(rbind(flag, option_text(values)))
    }
  }
  unlist(Map(texts, flags, options), use.names = FALSE)
}

# Numbers without exponents: 1e5 must be 100000 on a command line.
option_text <- function(values) {
  values <- plain_numbers(values)
  if (is.numeric(values)) {
    values <- with_decimal_point(
      vapply(values, format, "", scientific = FALSE, digits = 15L, trim = TRUE)
    )
  }
  as.character(values)
}

#' Stop a server that this session started
#'
#' The server finishes running calls and closes its environments. It is killed if it does not end
#' within 15 seconds.
#'
#' @param client The client returned by [gym_server_start()]. `NULL`, the default, is the session's
#'   own server, that of [gym_client()].
#' @return Nothing, invisibly. You may stop a server twice.
#' @section Errors: `gym_error_argument` for a server that this session did not start.
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' gym_server_stop(server)
gym_server_stop <- function(client = NULL) {
  stop_server(session_server(client))
  invisible()
}

#' Read a server's log
#'
#' Return the warnings and errors of a server that this session started, and the output of its
#' environments. This also works after its end. The same warning, or error of an environment, is
#' logged once.
#'
#' @inheritParams gym_server_stop
#' @return A character vector with an element for each line; `character(0)` if there is no output.
#' @inheritSection gym_server_stop Errors
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' gym_server_log(server)
#' gym_server_stop(server)
gym_server_log <- function(client = NULL) {
  log_tail(session_server(client)$log, n = Inf)
}

session_server <- function(client, call = rlang::caller_env()) {
  client <- client %||% the_session$client
  if (is.null(client)) {
    abort_wrong(NULL, NULL, call, "This session has started no server.")
  }
  check_client(client, call = call)
  the_session$servers[[client$remote_base]] %||% abort_wrong(
    NULL, NULL, call, "The server at {client$remote_base} was not started by this session.",
    i = "`shutdown_server()` stops any server."
  )
}

# Stops the session's servers and closes its instances on others, in a limited time:
#
# 1. Close the standard input of each server. Servers then close their environments and end.
# 2. Close instances on other servers, within half of the time.
# 3. At half of the time, send a signal to servers that still run.
# 4. Abandon a server that takes longer than the whole time, perhaps to finish a video.
end_session <- function(session) {
  if (isTRUE(session$ended)) {
    return()
  }
  session$ended <- TRUE
  deadline <- now() + closing_time
  servers <- if (Sys.getpid() == session$pid) {
    Filter(function(server) server$process$is_alive(), session$servers)
  }
  await_ends <- function(until) {
    for (server in servers) await_end(server$process, until - now())
  }
  lapply(servers, close_server_input)
  close_session_instances(closing_time / 2)
  await_ends(deadline - closing_time / 2)
  lapply(servers, terminate_server)
  await_ends(deadline)
}
