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
  check_number(timeout, min = 0.001, max = 1e6)
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

# What a client holds besides its address: its line to the server and what it
# knows of the server's instances. Made anew when the client finds itself in
# another process or restored from a file, where a line is void and its key
# belongs to the original.
connection <- function(client) {
  state <- client$state
  if (!identical(state$session, the_session) || state$pid != Sys.getpid()) {
    line <- open_line(client)
    suspendInterrupts({
      state$line <- line
      state$instances <- new.env(parent = emptyenv())
      state$to_close <- character()
      state$pid <- Sys.getpid()
      state$session <- the_session
    })
  }
  state
}

# The line that a call may use. R may run a finalizer at any time, also while curl
# waits for an answer, and a finalizer may close an environment: a call inside
# another one gets a line of its own.
free_line <- function(client) {
  line <- connection(client)$line
  while (line$busy) {
    if (is.null(line$inner)) {
      line$inner <- open_line(client, fetch_aside)
    }
    line <- line$inner
  }
  line
}

# Two curl handles (setting one up anew for each call costs more than the call), and
# the key and number of the last call that must not be done twice.
open_line <- function(client, fetch = curl::curl_fetch_memory) {
  line <- new.env(parent = emptyenv())
  line$fetch <- fetch
  line$busy <- FALSE
  line$key <- new_key()
  line$number <- 0
  line$get <- open_handle(client)
  line$post <- open_handle(client)
  line$body <- raw()
  line$sent <- 0L
  line$body_size <- -1
  curl::handle_setopt(line$post, post = TRUE, readfunction = function(nbytes, ...) {
    read_body(line, nbytes)
  })
  line
}

# As curl_fetch_memory(), which has one engine for all and cannot run inside itself.
fetch_aside <- function(url, handle) {
  pool <- curl::new_pool()
  outcome <- NULL
  curl::handle_setopt(handle, url = url)
  curl::multi_add(
    handle,
    done = function(response) outcome <<- response,
    fail = function(reason) outcome <<- simpleError(reason),
    pool = pool
  )
  curl::multi_run(pool = pool)
  if (inherits(outcome, "error")) stop(outcome)
  outcome
}

# Called by curl when it wants more of the body. Asked for the body a second time
# (curl repeating a call by itself) there is nothing left and curl gives up: only
# send() may repeat a call.
read_body <- function(line, nbytes) {
  size <- min(nbytes, length(line$body) - line$sent)
  chunk <- line$body[line$sent + seq_len(size)]
  line$sent <- line$sent + size
  chunk
}

open_handle <- function(client) {
  handle <- httr::handle(client$remote_base)$handle
  curl::handle_setopt(
    handle,
    connecttimeout_ms = min(10, client$timeout) * 1000,
    timeout_ms = client$timeout * 1000,
    followlocation = FALSE
  )
  if (is_loopback(client$remote_base) && is.null(client$config$options$proxy)) {
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

is_loopback <- function(base) {
  grepl("^https?://(127[.][0-9.]+|localhost|\\[::1\\])(:[0-9]+)?(/|$)", base)
}

# Unlike anything drawn from R's generator this is never the same twice.
new_key <- function() {
  the_session$keys <- (the_session$keys %||% 0) + 1
  rlang::hash(list(
    Sys.info()[["nodename"]], Sys.getpid(), as.numeric(Sys.time()), tempfile(""), the_session$keys
  ))
}

# Requests ----------------------------------------------------------------------

#' Send a request
#'
#' The one function that speaks HTTP. A GET whose connection broke is sent again,
#' and so is a POST that is done `once`, under the number by which the server
#' knows the repeat.
#' @param fields JSON texts of the fields of a POST's body, named; `NULL` for a GET.
#' @return What [curl::curl_fetch_memory()] returns, whatever the status, with the
#'   `request` that was sent: its `key` and `number`.
#' @noRd
send <- function(client, route, fields = NULL, once = FALSE, call = rlang::caller_env()) {
  # Arguments may hold calls of their own, as in env_reset(x, env_create(x, id)):
  # those come first and have the line for themselves.
  force(route)
  force(fields)
  line <- free_line(client)
  line$busy <- TRUE
  on.exit(line$busy <- FALSE)
  request <- if (once) next_request(line)
  if (is.null(fields)) {
    handle <- line$get
  } else {
    handle <- line$post
    fields <- c(fields, request = request_json(request))
    load_body(line, json_object(paste0('"', names(fields), '"'), fields))
  }
  response <- fetch(client, line, handle, route, repeatable = once || is.null(fields), call)
  response$request <- request
  response
}

next_request <- function(line) {
  line$number <- line$number + 1
  list(key = line$key, number = line$number)
}

request_json <- function(request) {
  if (!is.null(request)) {
    sprintf('{"key":"%s","number":%.0f}', request$key, request$number)
  }
}

# curl needs the length of a body beforehand, and setting it costs as much as half a
# call: small bodies are padded with blanks to one length.
load_body <- function(line, body) {
  bytes <- charToRaw(body)
  size <- max(length(bytes), small_body)
  line$body <- c(bytes, rep(as.raw(0x20), size - length(bytes)))
  if (size != line$body_size) {
    suspendInterrupts({
      curl::handle_setopt(line$post, postfieldsize_large = size)
      line$body_size <- size
    })
  }
}

small_body <- 256L

fetch <- function(client, line, handle, route, repeatable, call) {
  url <- paste0(client$remote_base, route)
  started <- proc.time()[["elapsed"]]
  attempt <- 1L
  repeat {
    line$sent <- 0L
    response <- tryCatch(line$fetch(url, handle), error = identity)
    if (!inherits(response, "error")) {
      return(response)
    }
    reason <- conditionMessage(response)
    if (grepl("aborted by an application callback", reason, fixed = TRUE)) {
      rlang::interrupt()
    }
    left <- client$timeout - (proc.time()[["elapsed"]] - started) - 0.1 * attempt
    if (!repeatable || attempt == max_attempts || left <= 0 || !connection_broke(reason)) {
      abort_connection(client$remote_base, reason, call)
    }
    Sys.sleep(0.1 * attempt)
    # All attempts together may take as long as one call.
    curl::handle_setopt(handle, timeout_ms = left * 1000)
    on.exit(curl::handle_setopt(handle, timeout_ms = client$timeout * 1000))
    attempt <- attempt + 1L
  }
}

max_attempts <- 4L

# What libcurl says when a connection that stood went away, as opposed to one that
# could not be made or an answer that took too long.
connection_broke <- function(reason) {
  grepl(
    paste(
      "Recv failure|Send failure|Empty reply|Server returned nothing|data rewind",
      "Connection (reset|died)|Broken pipe|transfer closed",
      "Failed (sending|receiving) data|Failure when receiving data",
      sep = "|"
    ),
    reason
  )
}

# Make a call that the server carries out exactly once, and read its answer.
post_once <- function(client, route, fields = NULL, call = rlang::caller_env()) {
  fields <- fields %||% character()
  read_answer(send(client, route, fields, once = TRUE, call = call), "POST", call)
}

# Make any other call, and read its answer.
get_answer <- function(client, route, call = rlang::caller_env()) {
  read_answer(send(client, route, call = call), "GET", call)
}

post_answer <- function(client, route, data, call = rlang::caller_env()) {
  fields <- vapply(data, to_json, "")
  read_answer(send(client, route, fields, call = call), "POST", call)
}

#' Read an answer or raise its error
#' @param response What [send()] returned.
#' @return The parsed answer, `NULL` for an empty one.
#' @noRd
read_answer <- function(response, method, call = rlang::caller_env()) {
  answer <- if (response$status_code != 204L) parsed_body(response)
  check_echo(response, answer, call)
  if (response$status_code >= 400L) {
    abort_http(response$status_code, answer, paste(method, response$url), call)
  }
  if (response$status_code != 204L && is.null(answer)) {
    abort_no_answer(response, call)
  }
  answer
}

# The JSON object of an answer; NULL for whatever else somebody else may have sent.
parsed_body <- function(response) {
  answer <- tryCatch(from_json(rawToChar(response$content)), error = function(cnd) NULL)
  if (is.list(answer)) answer
}

# An answer to another call would be worse than none.
check_echo <- function(response, answer, call) {
  sent <- response$request
  if (is.null(sent)) {
    return()
  }
  echo <- if (response$status_code == 204L) echo_in_header(response) else answer$request
  if (!is.null(echo) && !(echo$number == sent$number && identical(echo$key, sent$key))) {
    abort_connection(response$url, "The answer that came belongs to another call.", call)
  }
}

echo_in_header <- function(response) {
  echo <- curl::parse_headers_list(response$headers)[["gym-request"]]
  if (!is.null(echo)) {
    parts <- strsplit(echo, " ", fixed = TRUE)[[1L]]
    list(key = parts[[1L]], number = as.numeric(parts[[2L]]))
  }
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
  check_route(route)
  answer <- post_answer(x, route, as.list(data))
  if (is.null(answer)) invisible() else answer
}

#' @rdname post_request
#' @export
get_request <- function(x, route, data = NULL) {
  check_client(x)
  check_route(route)
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
  if (!inherits(response, "response")) {
    abort_argument(response, "an answer of httr's", "response", rlang::current_env())
  }
  answer <- read_answer(response, response$request$method %||% "Request to")
  if (is.null(answer)) invisible() else answer
}
