# Calls, each of which becomes one request.

#' Send a request
#'
#' The one function that speaks HTTP. A GET whose connection broke is sent again,
#' and so is a POST that is done `once`, under the number by which the server
#' knows the repeat.
#' @param fields JSON texts of the fields of a POST's body, named; `NULL` for a GET.
#' @param tensors Tensors for a body that is not JSON, see [write_tensors()].
#' @param take_tensors Whether the answer should come as tensors.
#' @param request The key and number of a POST that is done once; by default the line's next.
#' @return What [curl::curl_fetch_memory()] returns, whatever the status, with the
#'   `request` that was sent (its `key` and `number`) and the parsed `answer`, `NULL`
#'   for none or one that cannot be read.
#' @noRd
send <- function(client, route, fields = NULL, tensors = NULL, take_tensors = FALSE,
                 once = FALSE, request = NULL, call = rlang::caller_env()) {
  # Arguments may hold calls of their own, as in env_reset(x, env_create(x, id)):
  # those come first and have the line for themselves.
  force(route)
  force(fields)
  force(tensors)
  line <- free_line(client)
  line$busy <- TRUE
  on.exit(line$busy <- FALSE)
  channel <- find_channel(client, line, channel_kind(fields, tensors, take_tensors))
  if (once && is.null(request)) {
    request <- next_request(line$numbers)
  }
  if (!is.null(fields)) {
    load_body(line, channel, request_body(fields, request, tensors))
  }
  # A classic server would do the repeat as well.
  repeatable <- once && !isTRUE(client$state$classic) || is.null(fields)
  response <- fetch(client, line, channel, route, request, repeatable, call)
  response$request <- request
  response
}

channel_kind <- function(fields, tensors, take_tensors) {
  if (!is.null(tensors)) {
    "send_tensors"
  } else if (is.null(fields)) {
    if (take_tensors) "get_tensors" else "get"
  } else {
    if (take_tensors) "post_tensors" else "post"
  }
}

next_request <- function(numbers) {
  numbers$number <- numbers$number + 1
  list(key = numbers$key, number = numbers$number)
}

request_body <- function(fields, request, tensors = NULL) {
  fields <- c(fields, request = request_json(request))
  if (is.null(tensors)) charToRaw(json_object(fields)) else write_tensors(tensors, fields)
}

request_json <- function(request) {
  if (!is.null(request)) {
    sprintf('{"key":"%s","number":%.0f}', request$key, request$number)
  }
}

# curl needs the length of a body beforehand, and setting it costs as much as half a
# call: small bodies are padded with blanks to one length.
load_body <- function(line, channel, bytes) {
  line$body <- padded(bytes, channel$kind)
  size <- length(line$body)
  if (size != channel$body_size) {
    suspendInterrupts({
      curl::handle_setopt(channel$handle, postfieldsize_large = size)
      channel$body_size <- size
    })
  }
}

# Blanks at the end of a JSON text mean nothing.
padded <- function(bytes, kind) {
  padding <- 256L - length(bytes)
  if (padding > 0L && kind$sends == json_type) c(bytes, rep(as.raw(0x20), padding)) else bytes
}

# Make a call that the server carries out exactly once, and read its answer.
post_once <- function(client, route, fields = NULL, tensors = NULL, take_tensors = FALSE,
                      request = NULL, call = rlang::caller_env()) {
  fields <- fields %||% character()
  response <- send(client, route, fields, tensors, take_tensors, TRUE, request, call)
  read_answer(response, "POST", call)
}

# Make any other call, and read its answer.
get_answer <- function(client, route, take_tensors = FALSE, call = rlang::caller_env()) {
  read_answer(send(client, route, take_tensors = take_tensors, call = call), "GET", call)
}

post_answer <- function(client, route, fields = character(), call = rlang::caller_env()) {
  read_answer(send(client, route, fields, call = call), "POST", call)
}
