# How a request passes through curl. A line is one of curl's handles, with the body that it sends
# next. The handle keeps its connection to the server. A client has one line.

json_type <- "application/json"
tensors_type <- "application/x-safetensors"
# A message of a stream.
message_type <- "application/x-gym-message"
# Tensors in R's order, column by column. A server that does not know this type answers row by row.
column_tensors_type <- "application/x-safetensors; order=column"
accepted_tensors <- paste0(column_tensors_type, ", ", tensors_type, ";q=0.9")

# The client's line. While libcurl calls R, R may run a finalizer, which may make a request. That
# request gets a line of its own.
line_of <- function(client) {
  home <- client_state(client)$home
  line <- home$line %||% (home$line <- new_line(client))
  if (line$busy) new_line(client) else line
}

new_line <- function(client) {
  line <- rlang::env(client = client, busy = FALSE, kind = NULL, body = raw(), sent = 0L, size = 0L)
  config <- client_config(client)
  line$headers <- c(
    # An empty Expect keeps curl from waiting for permission to send a body.
    "Expect" = "", "User-Agent" = paste0("gym-R/", utils::packageVersion("gym")),
    "Authorization" = if (!is.null(client$token)) paste("Bearer", client$token())
  )
  line$headers[names(config$headers)] <- config$headers
  line$handle <- curl::new_handle(.list = c(
    list(
      readfunction = body_reader(line), followlocation = FALSE,
      connecttimeout_ms = min(10, client$timeout) * 1000, timeout_ms = client$timeout * 1000,
      # The data of thousands of sub-environments then arrive in few pieces.
      buffersize = 2^18, upload_buffersize = 2^18
    ),
    # A proxy would look for the server on the proxy's own machine.
    if (is_loopback(client$remote_base) && is.null(config$options$proxy)) list(noproxy = "*"),
    config$options,
    # Refuse compressed answers: nobody knows their size in advance.
    list(accept_encoding = NULL, noprogress = FALSE, xferinfofunction = watch_over(client$state))
  ))
  line
}

#' Prepare a line for the next request
#' @inheritParams send_request
#' @noRd
set_line <- function(line, method, body, sends, accepts) {
  # Setting an option takes a tenth of the time of a request, so only set what changes.
  kind <- c(method, sends, accepts)
  if (!identical(kind, line$kind)) {
    headers <- c("Content-Type" = sends, "Accept" = accepts)
    headers <- c(headers[setdiff(names(headers), names(line$headers))], line$headers)
    curl::handle_setheaders(line$handle, .list = as.list(headers))
    curl::handle_setopt(line$handle, post = method == "POST")
    line$kind <- kind
  }
  if (length(body) != line$size) {
    curl::handle_setopt(line$handle, postfieldsize_large = length(body))
    line$size <- length(body)
  }
  line$body <- body
}

# Makes the function from which curl reads the body. If curl itself repeats a request, it asks for
# the body a second time, gets nothing and fails. This is intended: only send_request() may repeat a
# request.
body_reader <- function(line) {
  function(nbytes, ...) {
    if (line$sent == 0L && length(line$body) <= nbytes) {
      line$sent <- length(line$body)
      return(line$body)
    }
    piece <- line$sent + seq_len(min(nbytes, length(line$body) - line$sent))
    line$sent <- line$sent + length(piece)
    line$body[piece]
  }
}

#' Make the function that libcurl calls during a request, about ten times
#'
#' It ends the request after an interrupt, or if the answer is too large. In the second case it sets
#' `state$too_large`.
#' @noRd
watch_over <- function(state) {
  received <- -1
  function(down, up) {
    # Let an interrupt happen here. While more data arrives, skip this: libcurl calls again at once.
    if (down[[2L]] == received) allowInterrupts(Sys.sleep(0)) else received <<- down[[2L]]
    down[[2L]] <= small_answer || {
      # An option that is not a number is reported after the request.
      most <- answer_bytes_option()
      state$too_large <- !is_number(most) || down[[2L]] > most
      !state$too_large
    }
  }
}

#' Perform a request
#'
#' An interrupt must not jump out of libcurl, which could not be used afterwards. So interrupts
#' happen only in watch_over(), which tells libcurl to end the request.
#' @return The response, or the connection's error.
#' @noRd
fetch <- function(line, url, call) {
  line$sent <- 0L
  line$client$state$too_large <- FALSE
  # Use the handle's own connection, not one of a pool. With a server for each user, a connection
  # belongs to one token; and a forked process must not read its parent's answers.
  old <- options(curl_interrupt = FALSE)
  on.exit(options(old))
  suspendInterrupts({
    response <- tryCatch(curl::curl_fetch_memory(url, line$handle), error = identity)
    raise_own_stop(response, line$client, call)
  })
  whole_response(response)
}

# Adds a request to a pool. `done` gets the response or the connection's error.
start_request <- function(line, url, pool, done) {
  line$sent <- 0L
  curl::handle_setopt(line$handle, url = url)
  curl::multi_add(
    line$handle, done = done, fail = function(reason) done(simpleError(reason)), pool = pool
  )
}

# Raises the error of a request that watch_over() has ended. Newer versions of curl signal an
# interrupt for both reasons.
raise_own_stop <- function(response, client, call) {
  aborted <- inherits(response, "error") &&
    grepl("aborted by (an application )?callback|Callback aborted", conditionMessage(response))
  if (aborted) {
    tryCatch(allowInterrupts(Sys.sleep(0)), interrupt = function(cnd) NULL)
    if (client$state$too_large) {
      abort_too_large(base = client$remote_base, call = call)
    }
    allowInterrupts(rlang::interrupt())
  }
}

# Returns the response, or an error if the connection ended within the header. libcurl takes that
# for an answer without content.
whole_response <- function(response) {
  end <- as.raw(c(0x0d, 0x0a, 0x0d, 0x0a))
  cut <- !inherits(response, "error") && !length(response$content) &&
    !identical(utils::tail(response$headers, 4L), end)
  if (cut) simpleError("Connection died within the header of the answer") else response
}
