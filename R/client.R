#' Create a client for a Gym server
#'
#' A client knows where a server is and keeps one connection to it open. It
#' talks to no server until it is first used. Scripts that only want to play an
#' environment need none: [gym_client()] has one ready.
#'
#' A client may be saved with [saveRDS()], sent to another process and used in a
#' forked one; each copy makes a connection of its own.
#'
#' Calls that change something on the server (creating, resetting, stepping,
#' closing) carry a number. When a connection breaks before the answer has
#' arrived the client repeats the call under the same number, and the server
#' answers without doing it a second time.
#'
#' @param remote_base The server's address, a string such as
#'   `"http://127.0.0.1:5000"`.
#' @param timeout How long a call may take before it fails with
#'   `gym_error_connection`, in seconds; the default is 60. Connecting may take
#'   10 seconds of it.
#' @param config Further settings for the connection, made with httr:
#'   [httr::authenticate()], [httr::add_headers()], [httr::use_proxy()] or
#'   several of them joined by [c()].
#' @return An object of class `GymClient`, a list with the element
#'   `remote_base`.
#' @section Errors: `gym_error_argument` when the address is not an http or https
#'   URL or the timeout not a positive number.
#' @export
#' @examples
#' server <- create_GymClient("http://127.0.0.1:5000")
#' server
#'
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' instance_id <- env_create(server, "CartPole-v1")
#' env_reset(server, instance_id)
#' gym_server_stop(server)
create_GymClient <- function(remote_base, timeout = 60, config = httr::config()) {
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
  check_number(timeout, min = 0.001)
  if (!inherits(config, "request")) {
    must <- "made with httr, such as by httr::add_headers()"
    abort_argument(config, must, "config", rlang::current_env())
  }
  structure(
    list(
      remote_base = sub("/+$", "", remote_base),
      timeout = timeout,
      config = config,
      state = new.env(parent = emptyenv())
    ),
    class = "GymClient"
  )
}

#' @export
print.GymClient <- function(x, ...) {
  cat("<GymClient: ", x$remote_base, ">\n", sep = "")
  invisible(x)
}

check_client <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!inherits(x, "GymClient")) {
    abort_argument(x, "a client, as create_GymClient() or gym_client() makes it", arg, call)
  }
}

# The connection ----------------------------------------------------------------

# What a client holds besides its address: two curl handles (setting one up anew
# for each call costs more than the call), the key and number of its last call
# and what it knows of the server's instances. Made anew when the client finds
# itself in another process or restored from a file, where handles are void and
# its key belongs to the original.
connection <- function(client) {
  state <- client$state
  if (!identical(state$session, the_session) || state$pid != Sys.getpid()) {
    open_connection(client, state)
  }
  state
}

open_connection <- function(client, state) {
  state$session <- the_session
  state$pid <- Sys.getpid()
  state$key <- new_key()
  state$number <- 0
  state$instances <- new.env(parent = emptyenv())
  state$to_close <- character()
  state$get <- open_handle(client)
  state$post <- open_handle(client)
  state$body <- raw()
  state$body_size <- 0L
  curl::handle_setopt(
    state$post,
    post = TRUE,
    # Called by curl when it wants the body. Asked for the body a second time
    # (curl repeating a call by itself) it has nothing left and curl gives up:
    # only send() may repeat a call.
    readfunction = function(nbytes, ...) {
      size <- min(nbytes, length(state$body))
      chunk <- state$body[seq_len(size)]
      state$body <- state$body[-seq_len(size)]
      chunk
    }
  )
}

open_handle <- function(client) {
  handle <- httr::handle(client$remote_base)$handle
  curl::handle_setopt(
    handle,
    connecttimeout_ms = min(10, client$timeout) * 1000,
    timeout_ms = client$timeout * 1000,
    followlocation = FALSE
  )
  if (grepl("^https?://(127[.]|localhost|\\[::1\\])", client$remote_base)) {
    # A proxy that the system names would look for the server on its own machine.
    curl::handle_setopt(handle, noproxy = "*")
  }
  curl::handle_setopt(handle, .list = client$config$options)
  # An empty Expect keeps curl from asking for leave before it sends a body.
  headers <- c(
    "Content-Type" = "application/json", "Accept" = "application/json", "Expect" = "",
    "User-Agent" = paste0("gym-R/", utils::packageVersion("gym"))
  )
  custom <- client$config$headers
  curl::handle_setheaders(
    handle,
    .list = as.list(c(headers[setdiff(names(headers), names(custom))], custom))
  )
  if (Sys.getpid() != the_session$pid) {
    # curl's open connections belong to the process that was forked: on one of
    # them a child could read an answer meant for its parent or a sibling.
    curl::handle_setopt(handle, fresh_connect = TRUE, forbid_reuse = TRUE)
  }
  handle
}

# Unlike anything drawn from R's generator this is never the same twice.
new_key <- function() {
  the_session$keys <- (the_session$keys %||% 0) + 1
  rlang::hash(list(
    Sys.info()[["nodename"]], Sys.getpid(), as.numeric(Sys.time()), tempfile(""), the_session$keys
  ))
}

# The next number of a call that must not be done twice, as it stands in a body.
next_request <- function(state) {
  state$number <- state$number + 1
  sprintf('{"key":"%s","number":%.0f}', state$key, state$number)
}

# Requests ----------------------------------------------------------------------

#' Send a request
#'
#' The one function that speaks HTTP. A call whose connection broke is sent
#' again, unchanged, when `repeatable`: a GET, or a body with a number by which
#' the server knows the repeat.
#' @param body The JSON text of a POST, `NULL` for a GET.
#' @return What [curl::curl_fetch_memory()] returns, whatever the status.
#' @noRd
send <- function(client, route, body = NULL, repeatable = is.null(body),
                 call = rlang::caller_env()) {
  state <- connection(client)
  url <- paste0(client$remote_base, route)
  handle <- if (is.null(body)) state$get else state$post
  bytes <- if (!is.null(body)) pad_body(state, body)
  attempt <- 1L
  repeat {
    state$body <- bytes
    response <- tryCatch(curl::curl_fetch_memory(url, handle), error = identity)
    if (!inherits(response, "error")) {
      return(response)
    }
    reason <- conditionMessage(response)
    if (grepl("aborted by an application callback", reason, fixed = TRUE)) {
      rlang::interrupt()
    }
    if (!repeatable || attempt == max_attempts || !connection_broke(reason)) {
      abort_connection(client$remote_base, reason, call)
    }
    Sys.sleep(0.1 * attempt)
    attempt <- attempt + 1L
  }
}

max_attempts <- 4L

# What libcurl says when a connection that stood went away, as opposed to one
# that could not be made or an answer that took too long.
connection_broke <- function(reason) {
  grepl(
    paste(
      "Recv failure|Send failure|Empty reply|Server returned nothing|rewind",
      "Connection reset|Broken pipe|transfer closed|Failed (sending|receiving)",
      "Failure when receiving|Connection died|Connection was reset|recv|send",
      sep = "|"
    ),
    reason
  )
}

# curl needs the length of a body beforehand, and setting it costs as much as
# half a call: bodies are padded with blanks to a few sizes.
pad_body <- function(state, body) {
  bytes <- charToRaw(body)
  size <- 256L
  while (size < length(bytes)) size <- size * 2L
  if (size != state$body_size) {
    curl::handle_setopt(state$post, postfieldsize_large = size)
    state$body_size <- size
  }
  c(bytes, rep(as.raw(0x20), size - length(bytes)))
}

#' Make a numbered call that the server carries out exactly once
#'
#' @param fields JSON texts of the body's fields, named; `NULL`s are left out.
#' @return The parsed answer, `NULL` for an empty one.
#' @noRd
post_once <- function(client, route, fields = NULL, call = rlang::caller_env()) {
  # Arguments may hold calls of their own, as in env_reset(x, env_create(x, id)):
  # those come first, or this call's number would lie behind theirs.
  force(route)
  force(fields)
  request <- next_request(connection(client))
  body <- json_object(c(fields, request = request))
  answer <- parse_answer(
    send(client, route, body, repeatable = TRUE, call = call),
    request = paste("POST", paste0(client$remote_base, route)), call = call
  )
  check_echo(answer, connection(client), client, call)
  answer
}

json_object <- function(fields) {
  paste0("{", paste0('"', names(fields), '":', fields, collapse = ","), "}")
}

# An answer to another call would be worse than none.
check_echo <- function(answer, state, client, call) {
  echo <- answer$request
  if (!is.null(echo) && !(echo$number == state$number && identical(echo$key, state$key))) {
    abort_connection(client$remote_base, "The answer that came belongs to another call.", call)
  }
}

parse_answer <- function(response, request, call = rlang::caller_env()) {
  status <- response$status_code
  if (status == 204L) {
    return(NULL)
  }
  answer <- tryCatch(from_json(rawToChar(response$content)), error = function(cnd) NULL)
  if (status >= 400L) {
    abort_http(status, answer, request, call)
  }
  if (status != 200L || !is.list(answer)) {
    gym_abort(
      c(
        "The answer is not what a Gym server sends.",
        x = paste0(request, " gave status ", status, " and ", response$type %||% "no type", "."),
        i = "Is the address that of a Gym server?"
      ),
      class = "gym_error_connection",
      call = call
    )
  }
  answer
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
#'   `get_request()` those of its query: a named list, `NULL` for none.
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
  check_string(route)
  body <- if (length(data)) to_json(as.list(data)) else "{}"
  request_answer(x, route, body, "POST")
}

#' @rdname post_request
#' @export
get_request <- function(x, route, data = NULL) {
  check_client(x)
  check_string(route)
  request_answer(x, paste0(route, query_text(data)), NULL, "GET")
}

request_answer <- function(x, route, body, method, call = rlang::caller_env()) {
  answer <- parse_answer(
    send(x, route, body, call = call),
    request = paste(method, paste0(x$remote_base, route)), call = call
  )
  if (is.null(answer)) invisible() else answer
}

query_text <- function(data) {
  if (!length(data)) {
    return("")
  }
  values <- vapply(data, function(value) curl::curl_escape(enc2utf8(as.character(value))), "")
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
#' response <- httr::GET(paste0(gym_client()$remote_base, "/v1/envs/"))
#' parse_server_error_or_raise_for_status(response)
parse_server_error_or_raise_for_status <- function(response) {
  answer <- parse_answer(
    list(
      status_code = httr::status_code(response),
      type = httr::http_type(response),
      content = response$content
    ),
    request = response$url %||% "The request"
  )
  if (is.null(answer)) invisible() else answer
}
