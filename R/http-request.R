# Requests: the constant part is prepared and then performed. A step keeps its prepared request;
# other calls prepare one for a single use.

#' Prepare a request
#'
#' @param fields JSON texts of the fields that its body always has, named.
#' @param body A function of the other content of a body, and of the idempotency key, see
#'   [new_json_body()] and [new_tensors_body()].
#' @param sends_tensors,takes_tensors Whether its body is tensors, and whether the answer may be.
#' @param once Whether it has an idempotency key, by which the server recognises a repeated request.
#' @param repeatable Whether it may be made again if its connection broke.
#' @param read A function of a response and the idempotency key that reads the usual kind of answer.
#'   For any other answer it returns `NULL` or fails, and `result` handles it.
#' @param result A function of a parsed answer, which returns the result or raises an error.
#' @noRd
prepare_request <- function(client, route, method = "POST", fields = NULL,
                            body = new_json_body(fields), sends_tensors = FALSE,
                            takes_tensors = FALSE, once = FALSE,
                            repeatable = once || method == "GET",
                            read = function(response, key) NULL, result = identity) {
  list(
    client = client, url = paste0(client$remote_base, route), method = method, body = body,
    once = once, repeatable = repeatable, read = read, result = result,
    kind = if (sends_tensors) {
      "send_tensors"
    } else {
      paste0(if (method == "GET") "get" else "post", if (takes_tensors) "_tensors")
    }
  )
}

#' Perform a request
#'
#' All requests of a client use this function, except for several at a time. A repeatable request
#' whose connection broke is made again with the same idempotency key.
#' @param request From [prepare_request()].
#' @param content The other content of this body, besides the request's fields.
#' @param key The idempotency key, a list of `key`, `number` and perhaps `server`, the server that
#'   it is for; by default the connection's next.
#' @return The result of `read` or `result` of the request.
#' @noRd
perform_request <- function(request, content = NULL, call = rlang::caller_env(), key = NULL) {
  # The content may come from another request, as in env_step(x, id, env_action_space_sample(x,
  # id)). Make that one first, while the connection is free.
  force(content)
  client <- request$client
  connection <- client_state(client)$connection
  if (connection$busy) {
    connection <- inner_connection(connection)
  }
  connection$busy <- TRUE
  on.exit(connection$busy <- FALSE)
  handle <- connection$handles[[request$kind]] %||% add_handle(client, connection, request$kind)
  if (request$once && is.null(key)) {
    key <- next_key(connection$keys)
  }
  if (request$method == "POST") {
    connection$body <- request$body(content, key)
    size <- length(connection$body)
    if (size != handle$body_size) set_body_size(handle, size)
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
#' @return The result of `read` of the request. If there is none, an object with the attribute
#'   "unread", which is the response or the connection's error.
#' @noRd
attempt_request <- function(request, connection, handle, key) {
  state <- request$client$state
  state$too_large <- FALSE
  connection$sent <- 0L
  response <- NULL
  # Evaluating it returns from this function. tryCatch() would take three times as long.
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
    # Newer versions of curl signal an interrupt if an answer was stopped because of its size.
    interrupt = function(cnd) {
      if (state$too_large && is.null(response)) {
        response <<- simpleError("Too large")
        leave
      }
    }
  )
}

# Calls ----------------------------------------------------------------------------------

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

#' Make a request and return any response
#' @return As [curl::curl_fetch_memory()], for any status, with the parsed `answer`.
#' @noRd
any_response <- function(client, route, method = "POST", call = rlang::caller_env()) {
  read <- function(response, key) {
    if (!inherits(whole_response(response), "error")) with_answer(response)
  }
  perform_request(prepare_request(client, route, method, read = read), call = call)
}

# Bodies ---------------------------------------------------------------------------------

# Bodies of a prepared request differ only in the idempotency key's number and the content.

#' Make the function that writes a body in JSON
#'
#' @param fields JSON texts of the fields that it always has, named.
#' @return A function of the members of a JSON object, each followed by a comma, and of the
#'   idempotency key, which returns a raw vector. Without a key it has the fields only.
#' @noRd
new_json_body <- function(fields) {
  of_key <- ending <- NULL
  function(content, key) {
    if (is.null(key)) {
      return(charToRaw(paste0("{", sub(",$", "", paste0(content, json_members(fields))), "}")))
    }
    if (!identical(of_key, key$key)) {
      server <- if (!is.null(key$server)) paste0('"server":', to_json(key$server), ",")
      ending <<- paste0(
        json_members(fields), '"request":{"key":"', key$key, '",', server, '"number":'
      )
      of_key <<- key$key
    }
    bytes <- charToRaw(paste0("{", content, ending, sprintf("%.0f}}", key$number)))
    missing <- length(json_blanks) - length(bytes)
    if (missing > 0L) c(bytes, json_blanks[seq_len(missing)]) else bytes
  }
}

# curl needs the length of a body in advance, and setting it takes as long as half a request: small
# bodies are padded to one length. Blanks at the end of a JSON text are ignored.
json_blanks <- rep(as.raw(0x20), 256L)

# Each member followed by a comma.
json_members <- function(fields) {
  if (length(fields)) paste0("\"", names(fields), "\":", fields, ",", collapse = "") else ""
}

key_json <- function(key) sprintf('{"key":"%s","number":%.0f}', key$key, key$number)

#' Make the function that writes a body of tensors
#'
#' @param n The number of integers, if the content is integers.
#' @return A function like that of [new_json_body()]. Its content is a list as returned by
#'   [to_tensors()], or integers, the tensor "action".
#' @noRd
new_tensors_body <- function(fields, n = NULL) {
  of_integers <- if (!is.null(n)) {
    write_table(list(action = list(dtype = "I32", shape = n, bytes = raw(4 * n))))
  }
  # The bytes before the tensors, split at the number of the idempotency key. They are kept as long
  # as the number of digits does not change.
  parts <- NULL
  function(content, key) {
    integers <- is.integer(content)
    if (!integers && (is.null(key) || any(vapply(content, is.character, NA)))) {
      texts <- vapply(content, is.character, NA)
      # These are among the metadata, so the header differs each time.
      fields <- c(fields, if (any(texts)) c(texts = to_json(content[texts])),
                  if (!is.null(key)) c(request = key_json(key)))
      return(write_tensors(content[!texts], fields))
    }
    table <- if (integers) of_integers else tensors_table(content)
    digits <- charToRaw(sprintf("%.0f", key$number))
    known <- length(digits) == length(parts$digits) && identical(parts$table, table) &&
      identical(parts$key, key$key)
    if (!known) parts <<- split_header(fields, table, key, digits)
    header <- c(parts$before, digits, parts$after)
    if (!integers) {
      do.call(c, c(list(header), lapply(unname(content), `[[`, "bytes")))
    } else if (length(content) < join_as_integers) {
      c(header, writeBin(content, raw(), endian = "little"))
    } else {
      words <- readBin(header, "integer", length(header) / 4L, endian = "little")
      writeBin(c(words, content), raw(), endian = "little")
    }
  }
}

# From this number on the header and integers are joined as integers, which R does faster.
join_as_integers <- 1024L

split_header <- function(fields, table, key, digits) {
  header <- tensors_header(c(fields, request = key_json(key)), table)
  # The quotes of the request are escaped in the header.
  mark <- paste0('number\\":', rawToChar(digits))
  end <- regexpr(mark, rawToChar(header[-(1:8)]), fixed = TRUE) + 8L + nchar(mark) - 1L
  list(
    table = table, key = key$key, digits = digits,
    before = header[seq_len(end - length(digits))], after = header[-seq_len(end)]
  )
}
