#' Create a client for a Gym server
#'
#' A client holds the address of a server and one open connection to it. It contacts the server at
#' the first call. Scripts that only play environments do not need a client: [gym_client()] supplies
#' one.
#'
#' If nobody listens at an address of this machine, such as `"http://127.0.0.1:5000"`, the first
#' call in an interactive session asks once whether to start a server there, as [gym_server_start()]
#' does. In a script the first call fails, and the error says how to start a server.
#'
#' Steps and resets of an environment use a stream: each environment has its own WebSocket, which
#' takes a third of the time of an HTTP request. A session has at most 32 streams, for the
#' environments that it used last. Steps use HTTP if there can be no stream: with https, a proxy,
#' settings of httr or a `timeout` of less than a second, and after another process has stepped the
#' same environment. The results are the same. Print a client to see which way its steps go.
#'
#' You can save a client with [saveRDS()], send it to another process, or use it in a forked
#' process. Each copy opens its own connection.
#'
#' Calls that change something on the server (creating, resetting, stepping, closing) carry an
#' idempotency key. If a connection breaks before the answer arrives, the client repeats the call
#' with the same key. The server then returns its first answer again and does nothing twice.
#'
#' The client needs the server of this package. With the original gym-http-api server, creating an
#' environment raises a `gym_error_http` with code `not_supported`.
#'
#' @param remote_base The server's address, a string such as `"http://127.0.0.1:5000"`.
#' @param timeout The time after which a call fails with `gym_error_connection`, in seconds. The
#'   default is 60. Connecting may take at most 10 seconds of this time.
#' @param config Further settings for the connection, made with httr: [httr::authenticate()],
#'   [httr::add_headers()], [httr::use_proxy()] or several of them joined by [c()]. Settings made by
#'   [httr::set_config()] before a call also apply, except for a proxy if the server is on this
#'   machine.
#' @param token The token that the server requires, a string; `NULL` or `""` for none. The default
#'   is the server's own token if this session started it, and otherwise the environment variable
#'   `GYM_SERVER_TOKEN`, which keeps the token out of scripts. The client sends it with each call,
#'   only to this server. Printing and errors never show it. A saved client contains it, so keep
#'   such a file secret.
#' @return An object of class `GymClient`, a list with the element `remote_base`.
#' @section Errors: `gym_error_argument` if the address is not an http or https URL, the timeout is
#'   not a positive number or the token is not a string of visible ASCII characters. The first call
#'   raises `gym_error_server_start` if a server could not be started, and `gym_error_install` if
#'   its software could not be installed.
#' @export
#' @examples
#' server <- create_GymClient("http://gym.example.org:5000")
#' server
#'
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' instance_id <- env_create(server, "CartPole-v1")
#' env_reset(server, instance_id)
#' gym_server_stop(server)
create_GymClient <- function(remote_base, timeout = 60, config = httr::config(),
                             token = Sys.getenv("GYM_SERVER_TOKEN")) {
  is_default <- missing(token)
  # Evaluate the token first: any later error would show the call with it.
  token <- as_token(token)
  check_string(remote_base)
  if (!is_server_address(remote_base)) {
    abort_wrong(NULL, NULL, rlang::current_env(),
                "`remote_base` must be the address of a server, not \"{remote_base}\".",
                i = "An address looks like \"http://127.0.0.1:5000\".")
  }
  check_number(timeout, min = 0.001, max = 1e6)
  if (!inherits(config, "request")) {
    must <- "made with httr, such as by httr::add_headers()"
    abort_argument(config, must, "config", rlang::current_env())
  }
  if (is_default) token <- known_token(sub("/+$", "", remote_base))
  client <- new_client(remote_base, timeout, config, token)
  client$state$may_prompt <- TRUE
  client
}

#' Send a request to any route of the server
#'
#' These are building blocks of the classic client. Use them for routes that have no R function.
#' `get_request()` reads; `post_request()` changes something on the server.
#'
#' @inheritParams env_create
#' @param route The path of the request, a string such as `"/v1/envs/"`.
#' @param data A named list, or `NULL` for none. `post_request()` sends it as the fields of the JSON
#'   body, `get_request()` as the query, with one value each.
#' @return The answer's JSON as nested lists, `NULL` (invisibly) for an empty answer.
#' @section Errors: `gym_error_http` if the server refuses the request, `gym_error_connection` if
#'   there is no answer.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' get_request(client, "/v1/health/")$status
#' id <- post_request(client, "/v1/envs/", list(env_id = "CartPole-v1"))$instance_id
#' post_request(client, paste0("/v1/envs/", id, "/close/"))
post_request <- function(x, route, data = NULL) {
  data <- request_data(x, route, data)
  answer <- post_answer(x, route, json_texts(data))
  if (is.null(answer)) invisible() else answer
}

#' @rdname post_request
#' @export
get_request <- function(x, route, data = NULL) {
  data <- request_data(x, route, data)
  for (name in names(data)) {
    value <- data[[name]]
    if (!is.atomic(value) || length(value) != 1L || is.na(value)) {
      abort_argument(value, "one value", paste0("data$", name), rlang::current_env())
    }
  }
  answer <- get_answer(x, paste0(route, query_text(data)))
  if (is.null(answer)) invisible() else answer
}

# Checks the arguments of a request to any route. Returns the data as a list.
request_data <- function(x, route, data, call = rlang::caller_env()) {
  check_client(x, call = call)
  if (!rlang::is_string(route) || !startsWith(route, "/")) {
    abort_argument(route, "a path that begins with a slash", "route", call)
  }
  data <- as.list(data)
  check_named_list(data, call = call)
  data
}

query_text <- function(data) {
  # as.character() is lazy: R formats the numbers only when it reads them.
  values <- with_decimal_point(
    vapply(data, function(value) curl::curl_escape(enc2utf8(as.character(value))), "")
  )
  if (length(data)) paste0("?", paste0(names(data), "=", values, collapse = "&"))
}

#' Read a server's answer or raise its error
#'
#' The classic client does this with each answer. Use it in scripts that call httr directly.
#'
#' @param response The result of [httr::GET()] or [httr::POST()].
#' @return The answer's JSON as nested lists, `NULL` (invisibly) for an empty answer.
#' @section Errors: `gym_error_http` and `gym_error_http_` with the status, such as
#'   `gym_error_http_400`, if the server refused the request. `gym_error_connection` if the answer
#'   is not JSON.
#' @export
#' @examplesIf gym:::can_start_server()
#' # This server requires no token, so httr need not send one.
#' server <- gym_server_start(token = FALSE)
#' response <- httr::GET(paste0(server$remote_base, "/v1/envs/"))
#' parse_server_error_or_raise_for_status(response)
#' gym_server_stop(server)
parse_server_error_or_raise_for_status <- function(response) {
  if (!inherits(response, "response")) {
    abort_argument(response, "a response of httr", "response", rlang::current_env())
  }
  answer <- read_answer(response, response$request$method %||% "Request to")
  if (is.null(answer)) invisible() else answer
}

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
gym_client <- function() session_client()

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
    abort_wrong(NULL, NULL, call,
                "The variable GYM_SERVER_URL must be the address of a server, such as
                 \"http://127.0.0.1:5000\", not \"{url}\".")
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

# Questions to the user --------------------------------------------------------------------

#' Ask whether to start a server if nobody listens at a client's address
#'
#' For scripts written for the classic client, whose users started a server on this machine by hand.
#' The first request of a client asks, see [prompted_server_starts()]. It does not ask in a session
#' that is not interactive, nor again after a "no" for this address.
#' @return Whether a server was started.
#' @noRd
prompt_for_server <- function(client, call = rlang::caller_env()) {
  base <- client$remote_base
  place <- local_place(base)
  # An address behind a proxy is not on this machine.
  asks <- rlang::is_interactive() && !base %in% the_session$start_declined && !is.null(place) &&
    is.null(client$config$options$proxy) && !probe_server(base, timeout = 0.3)$listens
  if (!asks) {
    return(FALSE)
  }
  if (!ask_yes_no(paste0("No server runs at ", base, ". Start one there?"), TRUE, call = call)) {
    the_session$start_declined <- c(the_session$start_declined, base)
    return(FALSE)
  }
  # Without a token: the script's client has none.
  server <- start_server(place$port, options = list(host = place$host), token = FALSE, call = call)
  # The script may use another name for the same address, such as localhost.
  the_session$servers[[base]] <- the_session$servers[[server$remote_base]]
  everybody <- if (is.null(server$token)) ", for any account of this machine"
  cli::cli_inform(c(v = "The server at {base} is ready{everybody}. It stops with this R session."))
  TRUE
}
