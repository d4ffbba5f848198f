# Streams: WebSockets for the steps and resets of one instance, on sockets of base R. A request by
# curl and HTTP takes several times as long as a step itself. If there can be no stream, the same
# messages go by HTTP. inst/server/PROTOCOL.md describes them.

# R allows about 128 open connections in a session.
most_streams <- 32L

# A stream stays open if it was used in this number of last messages of the session; only other
# streams are closed to make room.
recent_messages <- 1000

#' Find the stream of an instance, and try to open it
#'
#' A stream is replaced in another process, in a later session, and after a change of httr's
#' settings, like the client's other connections.
#' @return An environment with the instance's idempotency `keys`. Its `con` is `NULL` if the next
#'   message must go by HTTP.
#' @noRd
stream_of <- function(instance) {
  stream <- instance$stream
  if (!identical(stream$session, the_session) || stream$pid != Sys.getpid() ||
        !identical(stream$config, getOption("httr_config"))) {
    if (is_own_stream(stream)) drop_stream(stream)
    stream <- instance$stream <- new_stream(instance, client_state(instance$client))
  }
  if (is.null(stream$con) && is.null(stream$why_http)) {
    open_stream(stream)
  }
  stream
}

new_stream <- function(instance, state) {
  stream <- new.env(parent = emptyenv())
  stream$client <- instance$client
  stream$state <- state
  stream$config <- getOption("httr_config")
  stream$pid <- Sys.getpid()
  stream$session <- the_session
  stream$place <- instance_place(instance$client, instance$id)
  stream$keys <- keys_of_place(stream$place)
  stream$route <- paste0(instance$route, "stream/?key=", stream$keys$key, "&order=column",
                         if (instance$takes_numbers) "&numbers=float64")
  stream$busy <- FALSE
  stream$failures <- 0L
  stream$used <- 0
  # Why messages always go by HTTP, as text.
  stream$why_http <- why_http(instance$client)
  stream
}

is_own_stream <- function(stream) {
  !is.null(stream) && identical(stream$session, the_session) && stream$pid == Sys.getpid()
}

#' Find out why the steps of a client's environments go by HTTP
#' @return The reason in words; `NULL` if they go by streams, as far as is known.
#' @noRd
why_http <- function(client) {
  base <- client$remote_base
  config <- client_config(client)
  names <- setdiff(names(config$options), "timeout_ms")
  if (!grepl("^http://[^/@]+(/|$)", base)) {
    "https"
  } else if (any(grepl("^proxy", names)) || !is_loopback(base) && has_proxy_variable()) {
    "a proxy"
  } else if (length(names) || length(config$headers)) {
    "settings of httr"
  } else if (timeout_of(client) < 1) {
    "a timeout of less than a second"
  } else {
    client$state$why_http
  }
}

has_proxy_variable <- function() {
  any(nzchar(Sys.getenv(c("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"))))
}

# Opening and closing --------------------------------------------------------------------------

open_stream <- function(stream) {
  if (!make_room_for_stream()) {
    return(FALSE)
  }
  stream$failures <- stream$failures + 1L
  # Close the socket also after an interrupt.
  con <- NULL
  on.exit(if (is.null(stream$con) && !is.null(con)) close(con))
  failed <- tryCatch(
    suppressWarnings({
      con <- connect_stream(stream)
      layout <- if (is_upgraded(stream, con)) {
        read_layouts(from_json(rawToChar(read_message(con)$content)))
      }
      is.null(layout)
    }),
    error = function(cnd) TRUE
  )
  if (failed) {
    # The request by HTTP will report the error, if there is one.
    if (stream$failures > 1L) stream$why_http <- stream$why_http %||% "no stream could be opened"
    return(FALSE)
  }
  suspendInterrupts({
    stream$layout <- layout
    stream$con <- con
    stream$failures <- 0L
    the_session$streams <- c(the_session$streams, list(stream))
  })
  TRUE
}

# The open streams of this process.
open_streams <- function() {
  is_open <- function(stream) is_own_stream(stream) && !is.null(stream$con)
  the_session$streams <- Filter(is_open, the_session$streams)
  the_session$streams
}

drop_streams <- function(is_meant) {
  for (stream in Filter(is_meant, open_streams())) drop_stream(stream)
}

# If there are too many streams, closes the one that was used least recently, unless it is still in
# use. Returns whether there is room for another.
make_room_for_stream <- function() {
  streams <- open_streams()
  if (length(streams) < most_streams) {
    return(TRUE)
  }
  used <- vapply(streams, function(stream) stream$used, 0)
  oldest <- streams[[which.min(used)]]
  unused <- oldest$used < the_session$messages - recent_messages
  if (unused) drop_stream(oldest)
  unused
}

connect_stream <- function(stream) {
  client <- stream$client
  parts <- regmatches(client$remote_base, regexec(address_pattern, client$remote_base))[[1L]]
  host <- gsub("^\\[|\\]$", "", parts[[2L]])
  port <- if (nzchar(parts[[3L]])) as.integer(sub(":", "", parts[[3L]])) else 80L
  timeout <- ceiling(timeout_of(client))
  con <- socketConnection(
    host, port, open = "r+b", blocking = TRUE, options = "no-delay", timeout = min(10, timeout)
  )
  lines <- c(
    paste0("GET ", parts[[4L]], stream$route, " HTTP/1.1"),
    paste0("Host: ", parts[[2L]], parts[[3L]]),
    "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
    paste0("Sec-WebSocket-Key: ", openssl::base64_encode(openssl::rand_bytes(16L))),
    paste0("User-Agent: gym-R/", utils::packageVersion("gym")),
    if (!is.null(client$token)) paste("Authorization: Bearer", client$token())
  )
  writeBin(charToRaw(paste0(c(lines, "", ""), collapse = "\r\n")), con)
  con
}

address_pattern <- "^http://(\\[[^]]*\\]|[^/:]+)(:[0-9]+)?(.*)$"

# Reads the head of the answer. If a proxy lets no stream pass, this is remembered.
is_upgraded <- function(stream, con) {
  status <- readLines(con, 1L)
  if (grepl("^HTTP/1.1 101 ", status)) {
    while (nzchar(sub("\r$", "", readLines(con, 1L)))) NULL
    socketTimeout(con, ceiling(timeout_of(stream$client)))
    return(TRUE)
  }
  if (grepl("^HTTP/1.1 (200|426) ", status)) {
    stream$why_http <- stream$state$why_http <- "a proxy before the server lets none pass"
  }
  FALSE
}

# The layout of actions, steps and resets, which the server sends first.
message_layout <- function(stream, call) {
  stream$layout %||% (
    stream$layout <- read_layouts(get_answer(stream$client, stream$route, call = call))
  )
}

# Each layout as a list of entries, see read_layout(); `NULL` if values have no fixed layout.
read_layouts <- function(tables) {
  layout_of <- function(table) {
    if (!is.null(table)) Map(c, lapply(table, read_entry, TRUE), lapply(table, `[`, "dtype"))
  }
  lapply(tables[c("action", "step", "reset")], layout_of)
}

# Closes a stream's socket, unless somebody else has closed it: another connection may have its
# number by now.
drop_stream <- function(stream) {
  con <- stream$con
  stream$con <- NULL
  stream$busy <- FALSE
  if (!is.null(con) && is_own_stream(stream) && is_same_connection(con)) close(con)
}

is_same_connection <- function(con) {
  tryCatch(identical(getConnection(con), con), error = function(cnd) FALSE)
}

# Messages -------------------------------------------------------------------------------------

#' Send a message by a stream and wait for its answer
#'
#' @param stream From [stream_of()], with a connection.
#' @param message How to write it and read its answers, see [step_message()].
#' @param content Its content after the number, a raw vector.
#' @param head The frame's and the message's head.
#' @return A list of one element, the result. If the stream broke, the number of the message, which
#'   must then be sent by HTTP.
#' @noRd
ask_stream <- function(stream, message, content, head, call) {
  keys <- stream$keys
  number <- keys$number <- keys$number + 1
  sent <- c(head, writeBin(number, raw(), endian = "little"), content)
  stream$used <- the_session$messages <- the_session$messages + 1
  stream$busy <- TRUE
  # After an interrupt, the next data would be the answer to this message: drop the stream.
  on.exit(if (stream$busy) drop_stream(stream))
  answer <- exchange(stream$con, sent, message$count)
  # The usual answer has arrays and nothing after them. Answers come in the order of the messages,
  # so the number only tells an answer from other frames.
  is_usual <- !is.null(message$usual) && length(answer) == message$count &&
    answer[[1L]] == message$usual && answer[[2L]] == 0 && answer[[3L]] == number
  # NA is possible: another frame, such as a ping, may have bytes that are not numbers.
  if (isTRUE(is_usual)) {
    stream$busy <- FALSE
    return(list(message$read(answer)))
  }
  for (attempt in 1:2) {
    answer <- finish_answer(stream, answer, message$count, call)
    if (!is.null(answer)) {
      stream$busy <- FALSE
      return(list(read_stream_answer(stream, message, answer, call)))
    }
    drop_stream(stream)
    if (attempt > 1L || !is.null(stream$why_http) || !open_stream(stream)) break
    stream$busy <- TRUE
    answer <- exchange(stream$con, sent, message$count)
  }
  number
}

# Sends a message and reads `count` numbers of the answer, or none if `count` is NULL. Returns NULL
# if the connection broke: R evaluates a default in its own function, so a handler that reads
# `broke` returns from exchange(). tryCatch() would take three times as long.
exchange <- function(con, sent, count, broke = return(NULL)) {
  withCallingHandlers(
    {
      if (!identical(getConnection(con), con)) broke
      writeBin(sent, con)
      if (is.null(count)) double() else readBin(con, "double", count, endian = "little")
    },
    error = function(cnd) broke,
    warning = function(cnd) broke
  )
}

#' Read the rest of an answer
#'
#' @param begun The first bytes of the answer, as numbers; `NULL` if the connection broke.
#' @param count How many numbers were asked for.
#' @return The content of the message; `NULL` if the stream has ended.
#' @noRd
finish_answer <- function(stream, begun, count, call) {
  if (is.null(begun)) {
    return(NULL)
  }
  begun <- writeBin(begun, raw(), endian = "little")
  # If fewer numbers came than asked for, no more will come.
  answer <- if (length(begun) == 8 * (count %||% 0)) {
    tryCatch(suppressWarnings(read_message(stream$con, begun)), error = function(cnd) NULL)
  }
  if (identical(c(answer$first, begun)[1L], as.raw(0x88))) {
    code <- if (is.null(answer)) begun[3:4] else answer$content[1:2]
    if (identical(code, taken_over)) {
      stream$why_http <- "another client has taken the stream over"
    }
    return(NULL)
  }
  if (is.null(answer) && is_same_connection(stream$con) &&
        !socketSelect(list(stream$con), FALSE, 0)) {
    seconds <- timeout_of(stream$client)
    abort_connection(
      stream$client$remote_base, paste("Operation timed out after", seconds, "seconds"), call
    )
  }
  answer$content
}

# 4001, the code of a closing frame if another client takes the stream over.
taken_over <- as.raw(c(4001 %/% 256, 4001 %% 256))

#' Read a message of the server
#' @param begun Its first bytes, as far as they have been read.
#' @return A list of the frame's `first` byte and its `content`. An error if the connection ends.
#' @noRd
read_message <- function(con, begun = raw()) {
  take <- function(size) {
    bytes <- readBin(con, "raw", size)
    if (length(bytes) < size) stop("The stream has ended.")
    bytes
  }
  if (!length(begun)) begun <- take(2)
  size <- as.integer(begun[[2L]])
  at <- 2
  if (size > 125) {
    at <- if (size == 126) 4 else 10
    if (length(begun) < at) begun <- c(begun, take(at - 2))
    size <- sum(as.integer(begun[3:at]) * 256^((at - 3):0))
  }
  if (size > max_answer_bytes()) abort_too_large()
  read <- begun[-seq_len(at)]
  rest <- take(size - length(read))
  # Avoid c(), which would take as long for a picture as reading it.
  list(first = begun[[1L]], content = if (length(read)) c(read, rest) else rest)
}

# The bytes of an answer before its arrays.
message_head_size <- 20L

# Reads an answer that is not the usual one: with infos, with other arrays, or with an error.
read_stream_answer <- function(stream, message, content, call) {
  if (length(content) < message_head_size) {
    abort_answer("It is shorter than the head of a message", call)
  }
  head <- readBin(content, "integer", 4L, size = 2L, signed = FALSE, endian = "little")
  form <- head[[1L]] %% 256L
  if (form == 0L) {
    json_size <- head[[3L]] + 65536 * head[[4L]]
    json <- if (json_size) json_answer(utils::tail(content, json_size))
    return(message$read_bytes(content, json))
  }
  response <- list(
    status_code = head[[2L]], content = content[-seq_len(message_head_size)],
    url = paste0(stream$client$remote_base, stream$route),
    type = if (form == 1L) json_type else column_tensors_type
  )
  message$request$read(read_answer(response, "POST", call))
}

#' Send a message by HTTP and wait for its answer
#' @inheritParams ask_stream
#' @param number The message's number, if a stream broke after the message was sent; otherwise
#'   `NULL`.
#' @noRd
post_message <- function(stream, message, content, head, number, call) {
  keys <- stream$keys
  number <- number %||% (keys$number <- keys$number + 1)
  # By HTTP, there is no head of a WebSocket frame: only the last 8 bytes are of the message.
  head <- head[length(head) - 7:0]
  body <- c(head, writeBin(number, raw(), endian = "little"), content)
  response <- send_request(
    stream$client, stream$route, "POST", body, message_type, repeatable = TRUE, call = call
  )
  if (identical(response$type, message_type)) {
    read_stream_answer(stream, message, response$content, call)
  } else {
    message$request$read(read_answer(response, "POST", call))
  }
}

#' Make the head of a message
#' @param size The size of its content after the number, in bytes.
#' @param what,form,flags As in the protocol.
#' @noRd
message_head <- function(size, what, form, flags = 0L) {
  total <- size + 16
  head <- if (total <= 125) {
    as.raw(c(0x82, 0x80 + total))
  } else if (total < 65536) {
    as.raw(c(0x82, 0xfe, total %/% 256, total %% 256))
  } else {
    as.raw(c(0x82, 0xff, floor(total / 256^(7:0)) %% 256))
  }
  # The content is masked with zero, which changes nothing.
  c(head, raw(4L), as.raw(c(what, form, flags)), raw(5L))
}
