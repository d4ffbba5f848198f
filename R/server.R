# Local servers: started by this session, ended with it. The server ends when its
# standard input closes, which happens however the R session ends.

# A forked child uses its parent's server, of whose process it cannot ask whether it runs.
is_running <- function(base) {
  server <- the_session$servers[[base]]
  !is.null(server) && (Sys.getpid() != the_session$pid || server$process$is_alive())
}

#' Start a server on this machine
#'
#' Starts the server that comes with the package as a process of its own and
#' waits until it takes connections. It stops with the R session, also when that
#' is killed.
#'
#' Python is looked for in `python`; in the environment variable `GYM_PYTHON`; in
#' an active virtual environment (`VIRTUAL_ENV`, `CONDA_PREFIX`); where
#' [gym_server_install()] has put it; on the `PATH`.
#' The first that can run the server is used. Where `python` or `GYM_PYTHON`
#' names one, no other is tried. [gym_sitrep()] shows the result.
#'
#' @section Where there is no Python:
#' Without a Python that can run the server an interactive session asks once whether to
#' install one, by [gym_server_install()], and then continues with the call. A
#' script stops with an error, or, with the environment variable `GYM_INSTALL=1`,
#' installs it without asking. Where `python` or `GYM_PYTHON` names a Python nothing
#' is installed.
#' @param port The port to listen on, a whole number; `NULL`, the default, takes
#'   a free one.
#' @param python Path of a Python 3.10 or newer, a string, or `NULL`.
#' @param ... Further options of the server, by name: `monitor_dir = "runs"` is
#'   its `--monitor-dir runs`. `log_level = "info"` logs what is made and closed,
#'   `allow_module = c("a", "b")` names Python modules whose environments may be
#'   made. Limits for all clients together are `max_instances` (environments, 1,000),
#'   `max_num_envs` (sub-environments of one, 16,384), `max_total_sub_envs` (four times as many),
#'   `max_processes` (of their own that environments have, 128), `max_rollout_processes` (that play
#'   whole episodes, one a core), `max_memory_mb` (of all
#'   environments, estimated before they are made, 4,096), `max_monitor_mb` (that all monitors
#'   together may write on the disk, 4,096), `max_watchers` (100),
#'   `max_body_mb` (of a request, 16), `max_call_seconds` (that a call may take before its
#'   environment is evicted, 300, 0 for no limit) and
#'   `idle_minutes` (until an environment that nobody uses or watches is evicted, 1,440,
#'   0 for never). `token_file = "token"` names a file with a token of 16
#'   characters or more, which every call must then carry in place of the server's own one.
#'   What else a server for a group takes (`isolate`, `max_worker_mb`, `allow_host`, `allow_path`,
#'   `no_auth`, `no_shutdown`) is described in `vignette("server", package = "gym")`.
#' @param timeout How long the start may take, in seconds; the default is 60.
#' @param token Whether the server asks for a token of its own, `TRUE` or `FALSE`. It makes one at
#'   its start and tells it to this session alone, so that no other account of the machine can use
#'   it: the client that is returned carries the token, and so does each one that
#'   [create_GymClient()] makes for the server's address in this session. Other processes, such as
#'   another R session or clients in other languages, need a token that they know, or `FALSE`. The
#'   default is `TRUE` for a server without `port`, and `FALSE` for one with a port, whose address
#'   scripts name: any account of the machine can use that one, which is said in a message of class
#'   `gym_message_open_server`. What `token_file`, `no_auth = TRUE` or the environment variable
#'   `GYM_SERVER_TOKEN` say comes first.
#' @return A client for the server, as [create_GymClient()] makes it.
#' @section Errors: `gym_error_server_start`, with the server's own message: no
#'   Python can run it, the port is taken, it did not start in time; `gym_error_install`
#'   when a Python environment was to be installed first, and could not be;
#'   `gym_error_argument`.
#' @seealso [gym_server_stop()], [gym_server_log()], [gym_client()]
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' env_list_all(server)
#' gym_server_stop(server)
gym_server_start <- function(port = NULL, python = NULL, ..., timeout = 60,
                             token = is.null(port)) {
  # First, as every later error would show the call.
  check_own_token(token)
  check_count(port, min = 0, max = 65535, allow_null = TRUE)
  check_string(python, allow_null = TRUE)
  check_number(timeout, min = 0.001)
  options <- list(...)
  client <- start_server(port, python, options, timeout, token)
  if (missing(token) && is.null(client$token) && !isTRUE(options$no_auth)) {
    cli::cli_inform(
      c(i = paste("The server at {client$remote_base} asks for no token: any account of this",
                  "machine can use it.")),
      class = "gym_message_open_server"
    )
  }
  client
}

check_own_token <- function(token, call = rlang::caller_env()) {
  hide_token(token)
  if (!is_flag(token)) {
    gym_abort(
      c(
        "`token` must be `TRUE` or `FALSE`.",
        i = paste0("`token_file = ` names a file that holds a token of yours, and the environment ",
                   "variable ", token_variable, " may hold it.")
      ),
      class = "gym_error_argument", argument = "token", call = call
    )
  }
}

#' Start a server with the first Python that can run it
#' @param token Whether it asks for a token of its own, unless there is another one.
#' @param install Whether a Python environment may be installed, after a question or as
#'   `GYM_INSTALL` says, when no Python can run the server.
#' @return A client for the server.
#' @noRd
start_server <- function(port = NULL, python = NULL, options = list(), timeout = 60, token = TRUE,
                         install = TRUE, call = rlang::caller_env()) {
  if (rlang::is_string(options$token_file)) {
    options$token_file <- path.expand(options$token_file)
  }
  arguments <- c(
    "-c", run_server, "--stop-on-stdin-eof", "--port", sprintf("%.0f", port %||% 0),
    if (token && !says_token(options)) "--own-token", server_options(options, call)
  )
  refusals <- character()
  # Launches the server with the first Python that can run it. Returns NULL when none can.
  launch_with_first <- function(pythons) {
    for (candidate in pythons) {
      server <- launch_server(candidate, arguments, timeout, call)
      if (is.list(server)) {
        server$token <- server$token %||% server_token(options, call)
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
  server$extra_hint <- function(extra) installed_extra_hint(extra, server$python)
  the_session$servers[[server$url]] <- server
  # At the session's end R runs the youngest finalizer first. One that is registered now, after the
  # process was started, runs before the one of processx: the process can still be asked to end.
  # The list keeps the object from being collected as garbage, which would run its finalizer early.
  ending <- new.env(parent = emptyenv())
  reg.finalizer(ending, function(ending) end_session(the_session), onexit = TRUE)
  the_session$endings <- c(the_session$endings, ending)
  new_client(server$url, token = server$token)
}

# How to install an extra on a server that runs from what gym_server_install() made, which finds it
# there; NULL for a server with another Python, which somebody else looks after.
installed_extra_hint <- function(extra, python) {
  if (is_installed_python(python)) {
    paste0("`gym_server_install(extras = \"", extra, "\")` installs it, and this server finds it")
  }
}

# Options in the form of a command line: log_level = "info" becomes --log-level info, TRUE becomes a
# flag, a vector one option for each element.
server_options <- function(options, call = rlang::caller_env()) {
  check_dots_named(options, "log_level = \"info\"", call = call)
  flags <- paste0("--", gsub("_", "-", names(options)))
  unlist(Map(
    function(flag, values) {
      if (isTRUE(values)) {
        flag
      } else if (length(values) && !isFALSE(values)) {
        as.vector(rbind(flag, option_text(values)))
      }
    },
    flags, options
  ), use.names = FALSE)
}

# Writes numbers without an exponent: 1e5 is 100000 on a command line.
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
#' The server finishes the calls under way and closes its environments; one that
#' does not end within 15 seconds is killed.
#'
#' @param client The client that [gym_server_start()] returned; `NULL`, the
#'   default, stands for the session's own server, that of [gym_client()].
#' @return Nothing, invisibly. Stopping a server twice does no harm.
#' @section Errors: `gym_error_argument` for a server that this session did not
#'   start.
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
#' Warnings and errors of a server that this session started, and what its
#' environments print; also after its end. A log beyond 8 MiB is cut to its last MiB.
#'
#' @inheritParams gym_server_stop
#' @return A character vector, one element a line; `character(0)` when the server
#'   wrote nothing.
#' @inheritSection gym_server_stop Errors
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start(log_level = "info")
#' gym_server_log(server)
#' gym_server_stop(server)
gym_server_log <- function(client = NULL) {
  log_tail(session_server(client)$log, n = Inf)
}

session_server <- function(client, call = rlang::caller_env()) {
  client <- client %||% the_session$client
  if (is.null(client)) {
    gym_abort(
      "This session has started no server.", class = "gym_error_argument", call = call
    )
  }
  check_client(client, call = call)
  the_session$servers[[client$remote_base]] %||% gym_abort(
    c(
      paste0("The server at ", client$remote_base, " was not started by this session."),
      i = "`shutdown_server()` stops any server."
    ),
    class = "gym_error_argument",
    call = call
  )
}

# Ends the session's servers and closes its instances on others, in a limited time:
#
# 1. The standard input of each server is closed, on which servers close their environments and end.
# 2. Instances on other servers are closed, within half of the time.
# 3. Servers that still run at half of the time are asked again, by a signal.
# 4. A server that takes longer than the whole time, perhaps to finish a video, is abandoned.
end_session <- function(session) {
  if (isTRUE(session$ended)) {
    return()
  }
  session$ended <- TRUE
  deadline <- proc.time()[["elapsed"]] + closing_time
  servers <- if (Sys.getpid() == session$pid) {
    Filter(function(server) server$process$is_alive(), session$servers)
  }
  lapply(servers, close_server_input)
  close_session_instances(closing_time / 2)
  stop_session_servers(servers, deadline)
}

stop_session_servers <- function(servers, deadline) {
  await_ends(servers, deadline - closing_time / 2)
  lapply(servers, terminate_server)
  await_ends(servers, deadline)
}

await_ends <- function(servers, deadline) {
  for (server in servers) {
    await_end(server$process, deadline - proc.time()[["elapsed"]])
  }
}
