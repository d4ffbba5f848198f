# Calls of the server's routes, each of which is one request.

#' Send a request
#'
#' All requests of a client go through here. A GET whose connection broke is sent again, and so is
#' a POST that is done `once`, with the same idempotency key, by which the server knows the repeat.
#' @param fields JSON texts of the fields of a POST's body, named; `NULL` for a GET.
#' @param tensors Tensors for a body that is not JSON, see [write_tensors()].
#' @param take_tensors Whether the answer should come as tensors.
#' @param key The idempotency key of a POST that is done once, a list of `key` and `number`; by
#'   default the connection's next.
#' @return What [curl::curl_fetch_memory()] returns, whatever the status, with the idempotency key
#'   that was sent, `key`, and the parsed `answer`, `NULL` for none or one that cannot be read.
#' @noRd
send <- function(client, route, fields = NULL, tensors = NULL, take_tensors = FALSE,
                 once = FALSE, key = NULL, call = rlang::caller_env()) {
  # Arguments may contain requests of their own, as in env_reset(x, env_create(x, id)): those are
  # evaluated first, while the connection is free.
  force(route)
  force(fields)
  force(tensors)
  connection <- free_connection(client)
  connection$busy <- TRUE
  on.exit(connection$busy <- FALSE)
  handle <- handle_of_kind(client, connection, handle_kind(fields, tensors, take_tensors))
  if (once && is.null(key)) {
    key <- next_key(connection$keys)
  }
  if (!is.null(fields)) {
    load_body(connection, handle, request_body(fields, key, tensors))
  }
  # A server with the classic protocol knows no idempotency keys and would do the repeat, too.
  repeatable <- once && !isTRUE(client$state$classic) || is.null(fields)
  response <- fetch(client, connection, handle, route, key, repeatable, call)
  response$key <- key
  response
}

handle_kind <- function(fields, tensors, take_tensors) {
  if (!is.null(tensors)) {
    "send_tensors"
  } else if (is.null(fields)) {
    if (take_tensors) "get_tensors" else "get"
  } else {
    if (take_tensors) "post_tensors" else "post"
  }
}

request_body <- function(fields, key, tensors = NULL) {
  fields <- c(fields, request = key_json(key))
  if (is.null(tensors)) charToRaw(json_object(fields)) else write_tensors(tensors, fields)
}

key_json <- function(key) {
  if (!is.null(key)) {
    sprintf('{"key":"%s","number":%.0f}', key$key, key$number)
  }
}

# curl needs the length of a body beforehand, and setting it costs as much as half a
# request: small bodies are padded with blanks to one length.
load_body <- function(connection, handle, bytes) {
  connection$body <- padded(bytes, handle$sends)
  size <- length(connection$body)
  if (size != handle$body_size) {
    set_body_size(handle, size)
  }
}

set_body_size <- function(handle, size) {
  suspendInterrupts({
    set_curl(handle$curl, postfieldsize_large = size)
    handle$body_size <- size
  })
}

# Blanks at the end of a JSON text mean nothing.
padded <- function(bytes, type) {
  padding <- 256L - length(bytes)
  if (padding > 0L && type == json_type) c(bytes, rep(as.raw(0x20), padding)) else bytes
}

# Makes a POST that the server carries out exactly once, and reads its answer.
post_once <- function(client, route, fields = NULL, tensors = NULL, take_tensors = FALSE,
                      key = NULL, call = rlang::caller_env()) {
  fields <- fields %||% character()
  response <- send(client, route, fields, tensors, take_tensors, TRUE, key, call)
  read_answer(response, "POST", call)
}

# Makes a GET, and reads its answer.
get_answer <- function(client, route, take_tensors = FALSE, call = rlang::caller_env()) {
  read_answer(send(client, route, take_tensors = take_tensors, call = call), "GET", call)
}

# Makes a POST without an idempotency key, and reads its answer.
post_answer <- function(client, route, fields = character(), call = rlang::caller_env()) {
  read_answer(send(client, route, fields, call = call), "POST", call)
}
