# Requests. Each is prepared, with what is the same whenever it is made, and performed. A step keeps
# its prepared request; any other call prepares one and throws it away.

#' Prepare a request
#'
#' @param fields JSON texts of the fields that its body always has, named.
#' @param body A function of what this body has beside them, and of the idempotency key, see
#'   [new_json_body()] and [new_tensors_body()].
#' @param sends_tensors,takes_tensors Whether its body is tensors, and whether those are wanted.
#' @param once Whether it has an idempotency key, by which the server knows a repeated request.
#' @param repeatable Whether it may be made again when its connection broke.
#' @param read A function of a response and the idempotency key that reads an answer as it nearly
#'   always is. `NULL`, or an error, for any other answer: that is left to `result`.
#' @param result A function of a parsed answer, which returns the result or says what is wrong.
#' @noRd
prepare_request <- function(client, route, method = "POST", fields = NULL,
                            body = new_json_body(fields), sends_tensors = FALSE,
                            takes_tensors = FALSE, once = FALSE,
                            repeatable = once || method == "GET",
                            read = function(response, key) NULL, result = identity) {
  list(
    client = client, url = paste0(client$remote_base, route), method = method, body = body,
    once = once, repeatable = repeatable, read = read, result = result,
    kind = handle_kind(method, sends_tensors, takes_tensors)
  )
}

#' Perform a request
#'
#' All requests of a client go through here, but for those of which several are under way at once.
#' One whose connection broke is made again where it is repeatable, with the same idempotency key.
#' @param request From [prepare_request()].
#' @param content What this body has beside the request's fields.
#' @param key The idempotency key, a list of `key` and `number`; by default the connection's next.
#' @return What `read` or `result` of the request return.
#' @noRd
perform_request <- function(request, content = NULL, call = rlang::caller_env(), key = NULL) {
  # The content may come of a request, as in env_step(x, id, env_action_space_sample(x, id)): that
  # is made first, while the connection is free.
  force(content)
  client <- request$client
  connection <- client_state(client)$connection
  if (connection$busy) {
    connection <- inner_connection(client, connection)
  }
  connection$busy <- TRUE
  on.exit(connection$busy <- FALSE)
  handle <- handle_of_kind(client, connection, request$kind)
  if (request$once && is.null(key)) {
    key <- next_key(connection$keys)
  }
  if (request$method == "POST") {
    load_body(connection, handle, request$body(content, key))
  }
  result <- attempt_request(request, connection, handle, key)
  if (is.null(attr(result, "unread"))) {
    return(result)
  }
  response <- attr(result, "unread")
  if (inherits(response, "error")) {
    result <- repeat_request(request, connection, handle, key, response, call)
    response <- attr(result, "unread")
    if (is.null(response)) return(result)
  }
  answer <- read_answer(with_answer(response), request$method, call)
  request$result(answer)
}

#' Make one attempt at a request
#'
#' @return What `read` of the request returns. Where that is nothing, something with the attribute
#'   "unread", which is the response or the connection's error.
#' @noRd
attempt_request <- function(request, connection, handle, key) {
  state <- request$client$state
  state$too_large <- FALSE
  connection$sent <- 0L
  response <- NULL
  # Looked at, it returns from this function. tryCatch() would take three times as long.
  delayedAssign("leave", return(structure(list(), unread = whole_response(response))))
  withCallingHandlers(
    {
      response <- connection$fetch(request$url, handle$curl)
      state$may_prompt <- FALSE
      request$read(response, key) %||% leave
    },
    error = function(cnd) {
      if (is.null(response)) response <<- cnd
      leave
    },
    # Newer versions of curl signal an interrupt when an answer was stopped for its size.
    interrupt = function(cnd) {
      if (state$too_large && is.null(response)) {
        response <<- simpleError("Too large")
        leave
      }
    }
  )
}

# Calls ----------------------------------------------------------------------------------

# Makes a POST that the server carries out exactly once, and reads its answer.
post_once <- function(client, route, call = rlang::caller_env()) {
  perform_request(prepare_request(client, route, once = TRUE), call = call)
}

# Makes a POST without an idempotency key, and reads its answer.
post_answer <- function(client, route, fields = NULL, call = rlang::caller_env()) {
  perform_request(prepare_request(client, route, fields = fields), call = call)
}

# Makes a GET, and reads its answer.
get_answer <- function(client, route, takes_tensors = FALSE, call = rlang::caller_env()) {
  perform_request(
    prepare_request(client, route, "GET", takes_tensors = takes_tensors), call = call
  )
}

#' Make a request whose answer may be anything
#' @return What [curl::curl_fetch_memory()] returns, whatever the status, with the parsed `answer`.
#' @noRd
any_response <- function(client, route, method = "POST", call = rlang::caller_env()) {
  read <- function(response, key) {
    if (!inherits(whole_response(response), "error")) with_answer(response)
  }
  perform_request(prepare_request(client, route, method, read = read), call = call)
}
