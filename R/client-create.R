#' Create a client for a Gym server
#'
#' A client knows where a server is and keeps one connection to it open. It
#' talks to no server until it is first used. Scripts that only want to play an
#' environment need none: [gym_client()] has one ready.
#'
#' In an interactive session, where nobody listens at an address of this machine such
#' as `"http://127.0.0.1:5000"`, the first call asks once whether to start a server there, as
#' [gym_server_start()] does. A script is not asked: with no server there the first
#' call fails and says what starts one.
#'
#' A client may be saved with [saveRDS()], sent to another process and used in a
#' forked one; each copy makes a connection of its own.
#'
#' Calls that change something on the server (creating, resetting, stepping,
#' closing) carry an idempotency key. When a connection breaks before the answer has
#' arrived the client repeats the call with the same key, and the server
#' answers without doing it a second time.
#'
#' A server that has the protocol of gym-http-api alone, as the original one does, is played
#' by the classic calls. What it would ignore (`num_envs`, a seed of a reset) is an error of class
#' `gym_error_http` with code `not_supported`, and so are [gym_make()] and all that is played with
#' it. Nor is a call repeated there when its connection breaks, as such a server would do it twice.
#'
#' @param remote_base The server's address, a string such as
#'   `"http://127.0.0.1:5000"`.
#' @param timeout How long a call may take before it fails with
#'   `gym_error_connection`, in seconds; the default is 60. Connecting may take
#'   10 seconds of it.
#' @param config Further settings for the connection, made with httr:
#'   [httr::authenticate()], [httr::add_headers()], [httr::use_proxy()] or
#'   several of them joined by [c()]. What [httr::set_config()] has set for the whole session
#'   at the time of a call holds, too, except for a proxy where the server is on this machine.
#' @param token What the server asks everybody for, a string; `NULL` or `""` for nothing. The
#'   default is the server's own token where this session started it, and else what the environment
#'   variable `GYM_SERVER_TOKEN` holds, so that no script has to. It is sent with each call, to this
#'   server only, and nothing that is printed and no error shows it. A saved client holds it: such a
#'   file is as secret as the token.
#' @return An object of class `GymClient`, a list with the element
#'   `remote_base`.
#' @section Errors: `gym_error_argument` when the address is not an http or https
#'   URL, the timeout not a positive number or the token no string of visible ASCII
#'   characters. The first call raises `gym_error_server_start` when a server
#'   that was to be started could not be, and `gym_error_install` when what it needs
#'   could not be installed.
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
  # First, as every later error would show the call.
  token <- as_token(token)
  check_string(remote_base)
  if (!grepl("^https?://[^/]", remote_base)) {
    gym_abort(
      c(
        paste0("`remote_base` must be the address of a server, not \"", remote_base, "\"."),
        i = "An address looks like \"http://127.0.0.1:5000\"."
      ),
      class = "gym_error_argument"
    )
  }
  check_number(timeout, min = 0.001, max = 1e6)
  if (!inherits(config, "request")) {
    must <- "made with httr, such as by httr::add_headers()"
    abort_argument(config, must, "config", rlang::current_env())
  }
  if (is_default) {
    token <- known_token(sub("/+$", "", remote_base))
  }
  client <- new_client(remote_base, timeout, config, token)
  client$state$may_prompt <- TRUE
  client
}

#' Send a request to any route of the server
#'
#' The building blocks of the classic client, kept for routes that have no
#' function of their own. `get_request()` reads, `post_request()` changes
#' something on the server.
#'
#' @inheritParams env_create
#' @param route The path of the request, a string such as `"/v1/envs/"`.
#' @param data For `post_request()` the fields of the request's JSON body, for
#'   `get_request()` those of its query, of one value each: a named list, `NULL` for none.
#' @return The answer's JSON as nested lists, `NULL` (invisibly) for an empty
#'   answer.
#' @section Errors: `gym_error_http` when the server refuses,
#'   `gym_error_connection` when there is no answer.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' get_request(client, "/v1/health/")$status
#' id <- post_request(client, "/v1/envs/", list(env_id = "CartPole-v1"))$instance_id
#' post_request(client, paste0("/v1/envs/", id, "/close/"))
post_request <- function(x, route, data = NULL) {
  check_client(x)
  check_route(route)
  data <- as.list(data)
  check_named_list(data)
  answer <- post_answer(x, route, json_texts(data))
  if (is.null(answer)) invisible() else answer
}

#' @rdname post_request
#' @export
get_request <- function(x, route, data = NULL) {
  check_client(x)
  check_route(route)
  data <- as.list(data)
  check_named_list(data)
  for (name in names(data)) {
    value <- data[[name]]
    if (!is.atomic(value) || length(value) != 1L || is.na(value)) {
      abort_argument(value, "one value", paste0("data$", name), rlang::current_env())
    }
  }
  answer <- get_answer(x, paste0(route, query_text(data)))
  if (is.null(answer)) invisible() else answer
}

check_route <- function(route, call = rlang::caller_env()) {
  if (!rlang::is_string(route) || !startsWith(route, "/")) {
    abort_argument(route, "a path that begins with a slash", "route", call)
  }
}

query_text <- function(data) {
  if (!length(data)) {
    return("")
  }
  # R writes the numbers of as.character() only when they are looked at.
  values <- with_decimal_point(
    vapply(data, function(value) curl::curl_escape(enc2utf8(as.character(value))), "")
  )
  paste0("?", paste0(names(data), "=", values, collapse = "&"))
}

#' Read a server's answer or raise its error
#'
#' What the classic client does with each answer; for scripts that use httr on
#' their own.
#'
#' @param response An answer as [httr::GET()] or [httr::POST()] return it.
#' @return The answer's JSON as nested lists, `NULL` (invisibly) for an empty
#'   answer.
#' @section Errors: `gym_error_http` and `gym_error_http_` with the status, such
#'   as `gym_error_http_400`, when the server refused; `gym_error_connection`
#'   when the answer is not JSON.
#' @export
#' @examplesIf gym:::can_start_server()
#' # One that asks for no token, as httr would have to send it.
#' server <- gym_server_start(token = FALSE)
#' response <- httr::GET(paste0(server$remote_base, "/v1/envs/"))
#' parse_server_error_or_raise_for_status(response)
#' gym_server_stop(server)
parse_server_error_or_raise_for_status <- function(response) {
  if (!inherits(response, "response")) {
    abort_argument(response, "an answer of httr's", "response", rlang::current_env())
  }
  response$answer <- tryCatch(parsed_body(response), error = function(cnd) NULL)
  answer <- read_answer(response, response$request$method %||% "Request to")
  if (is.null(answer)) invisible() else answer
}
