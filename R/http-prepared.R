# Calls that are made in every step: what does not change from one to the next is prepared once, and
# one attempt is made here. Whatever is unusual about it (the connection broke, the server refuses,
# the answer has another form) is left to what all other requests go through, with the same
# idempotency key.

#' Prepare the calls of one route
#'
#' @param sends Whether tensors are sent.
#' @param takes Whether tensors are wanted.
#' @param fields JSON texts of the fields that are the same in each call, named.
#' @param read A function of a response, the key and the number that were sent, which returns the
#'   result, or `NULL` where the response is unusual. It may fail, and changes nothing.
#' @param read_answer A function of a parsed answer, which returns the result or says what is wrong.
#' @noRd
prepare_call <- function(client, route, sends, takes, fields, read, read_answer) {
  prepared <- new.env(parent = emptyenv())
  prepared$route <- route
  prepared$url <- paste0(client$remote_base, route)
  prepared$sends <- sends
  prepared$takes <- takes
  prepared$kind <- handle_kind(character(), if (sends) list(), takes)
  prepared$fields <- fields
  prepared$read <- read
  prepared$read_answer <- read_answer
  prepared
}

#' Make a call
#'
#' @param prepared From [prepare_call()].
#' @param content What is sent: the members of a JSON object, each with a comma after it; or, where
#'   tensors are sent, a list as [to_tensors()] returns it, or integers, the tensor "action".
#' @return What the functions of the prepared call return.
#' @noRd
call_prepared <- function(client, prepared, content, call) {
  force(content)
  state <- client_state(client)
  connection <- state$connection
  if (connection$busy) {
    connection <- free_connection(client)
  }
  connection$busy <- TRUE
  on.exit(connection$busy <- FALSE)
  kind <- prepared$kind
  handle <- handle_of_kind(client, connection, kind)
  keys <- connection$keys
  number <- keys$number + 1
  keys$number <- number
  key <- keys$key
  bytes <- if (prepared$sends) {
    prepared_tensors(prepared, content, key, number)
  } else {
    prepared_json(prepared, content, key, number)
  }
  connection$body <- bytes
  if (length(bytes) != handle$body_size) {
    load_body(connection, handle, bytes)
  }
  state$too_large <- FALSE
  connection$sent <- 0L
  result <- one_attempt(connection, handle$curl, prepared, key, number, state)
  if (is.null(attr(result, "unread"))) {
    return(result)
  }
  sent <- list(key = key, number = number)
  response <- fetch(
    client, connection, handle, prepared$route, sent, !isTRUE(state$classic), call,
    received = attr(result, "unread")
  )
  response$key <- sent
  prepared$read_answer(read_answer(response, "POST", call))
}

# Returns the result; where it is unusual, something with the attribute "unread", which is the
# response or the connection's error.
one_attempt <- function(connection, handle, prepared, key, number, state) {
  response <- NULL
  # Looked at, it returns from this function. tryCatch() would take three times as long.
  delayedAssign("leave", return(structure(list(), unread = response)))
  withCallingHandlers(
    {
      response <- connection$fetch(prepared$url, handle)
      prepared$read(response, key, number) %||% leave
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

# Bodies ----------------------------------------------------------------------------------

json_blanks <- rep(as.raw(0x20), 256L)

prepared_json <- function(prepared, content, key, number) {
  if (!identical(prepared$key, key)) {
    prepared$request <- paste0(
      json_members(prepared$fields), '"request":{"key":"', key, '","number":'
    )
    prepared$key <- key
  }
  bytes <- charToRaw(paste0("{", content, prepared$request, sprintf("%.0f}}", number)))
  missing <- 256L - length(bytes)
  if (missing > 0L) c(bytes, json_blanks[seq_len(missing)]) else bytes
}

# Each member with a comma after it.
json_members <- function(fields) {
  if (length(fields)) paste0("\"", names(fields), "\":", fields, ",", collapse = "") else ""
}

# From this number on integers are put behind a header as integers: R joins them faster than bytes.
join_as_integers <- 1024L

prepared_tensors <- function(prepared, content, key, number) {
  if (prepared$has_texts) {
    return(tensors_with_texts(prepared, content, key, number))
  }
  digits <- charToRaw(sprintf("%.0f", number))
  if (is.integer(content)) {
    with_integers(prepared_header(prepared, prepared$integers_table, key, digits), content)
  } else {
    header <- prepared_header(prepared, tensors_table(content), key, digits)
    do.call(c, c(list(header), lapply(unname(content), `[[`, "bytes")))
  }
}

with_integers <- function(header, integers) {
  if (length(integers) < join_as_integers) {
    c(header, writeBin(integers, raw(), endian = "little"))
  } else {
    words <- readBin(header, "integer", length(header) / 4L, endian = "little")
    writeBin(c(words, integers), raw(), endian = "little")
  }
}

prepared_header <- function(prepared, table, key, digits) {
  parts <- prepared$header
  known <- length(digits) == length(parts$digits) && identical(parts$table, table) &&
    identical(parts$key, key)
  if (!known) {
    parts <- header_parts(prepared$fields, table, key, digits)
    prepared$header <- parts
  }
  c(parts$before, digits, parts$after)
}

# Texts stand among the metadata, so that the header is another one each time.
tensors_with_texts <- function(prepared, content, key, number) {
  texts <- vapply(content, is.character, NA)
  fields <- c(
    prepared$fields, texts = if (any(texts)) to_json(content[texts]),
    request = key_json(list(key = key, number = number))
  )
  write_tensors(content[!texts], fields)
}

# The header of a body, split at the number of the idempotency key, which has these digits.
header_parts <- function(fields, table, key, digits) {
  number <- rawToChar(digits)
  request <- paste0('{"key":"', key, '","number":', number, "}")
  header <- tensors_header(c(fields, request = request), table)
  # The quotes of the request are escaped in the header.
  mark <- paste0('number\\":', number)
  end <- regexpr(mark, rawToChar(header[-(1:8)]), fixed = TRUE) + 8L + nchar(mark) - 1L
  list(
    table = table, key = key, digits = digits,
    before = header[seq_len(end - length(digits))], after = header[-seq_len(end)]
  )
}

integers_table <- function(n) {
  write_table(list(action = list(dtype = "I32", shape = n, bytes = raw(4 * n))))
}
