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
    kind = if (sends_tensors) {
      "send_tensors"
    } else {
      paste0(if (method == "GET") "get" else "post", if (takes_tensors) "_tensors")
    }
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

# Bodies ---------------------------------------------------------------------------------

# Of a prepared request only little changes from one time to the next: the idempotency key's number,
# and what is given as content.

#' Make the function that writes a body of JSON
#'
#' @param fields JSON texts of the fields that it always has, named.
#' @return A function of the members of a JSON object, each with a comma after it, and of the
#'   idempotency key, which returns a raw vector. Without a key there are the fields alone.
#' @noRd
new_json_body <- function(fields) {
  of_key <- ending <- NULL
  function(content, key) {
    if (is.null(key)) {
      return(charToRaw(json_object(fields)))
    }
    if (!identical(of_key, key$key)) {
      ending <<- paste0(json_members(fields), '"request":{"key":"', key$key, '","number":')
      of_key <<- key$key
    }
    bytes <- charToRaw(paste0("{", content, ending, sprintf("%.0f}}", key$number)))
    missing <- length(json_blanks) - length(bytes)
    if (missing > 0L) c(bytes, json_blanks[seq_len(missing)]) else bytes
  }
}

# curl needs the length of a body beforehand, and setting it costs as much as half a request: small
# bodies are padded to one length. Blanks at the end of a JSON text mean nothing.
json_blanks <- rep(as.raw(0x20), 256L)

# Each member with a comma after it.
json_members <- function(fields) {
  if (length(fields)) paste0("\"", names(fields), "\":", fields, ",", collapse = "") else ""
}

key_json <- function(key) sprintf('{"key":"%s","number":%.0f}', key$key, key$number)

#' Make the function that writes a body of tensors
#'
#' @param n How many integers are sent where the content is integers.
#' @return A function as that of [new_json_body()]. Its content is a list as [to_tensors()] returns
#'   it, or integers, the tensor "action".
#' @noRd
new_tensors_body <- function(fields, n = NULL) {
  of_integers <- if (!is.null(n)) {
    write_table(list(action = list(dtype = "I32", shape = n, bytes = raw(4 * n))))
  }
  # All that stands before the tensors, split at the number of the idempotency key. It is kept as
  # long as that has as many digits.
  parts <- NULL
  function(content, key) {
    integers <- is.integer(content)
    if (!integers && any(texts <- vapply(content, is.character, NA))) {
      # They stand among the metadata, so that the header is another one each time.
      fields <- c(fields, texts = to_json(content[texts]), request = key_json(key))
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

# From this number on integers are put behind a header as integers: R joins them faster than bytes.
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
