# When a request is made again, for one or several at a time, and what happens otherwise.

max_attempts <- 4L

#' Make further attempts at a request
#' @param failure The connection's error that ended the first attempt.
#' @return As [attempt_request()], but a connection's error is raised.
#' @noRd
repeat_request <- function(request, connection, handle, key, failure, call) {
  client <- request$client
  timeout <- timeout_of(client)
  begun <- now() - curl::handle_data(handle$curl)$times[["total"]]
  attempt <- 1L
  reached <- FALSE
  repeat {
    reason <- conditionMessage(failure)
    raise_own_stop(client, reason, call)
    reached <- reached | curl::handle_data(handle$curl)$times[["pretransfer"]] > 0
    if (curl_refused(reason)) {
      handle <- replace_handle(client, connection, handle)
    }
    pause <- pause_before_next(request, failure, attempt, connection$sent == 0L)
    left <- timeout - (now() - begun) - (pause %||% 0)
    if (!is.null(pause) && left > 0) {
      Sys.sleep(pause)
      attempt <- attempt + 1L
    } else if (prompted_server_starts(client, reached, call)) {
      begun <- now()
      left <- timeout
      attempt <- 1L
    } else {
      abort_connection(client$remote_base, reason, call, reached)
    }
    # All attempts together may take as long as one request.
    set_curl(handle$curl, timeout_ms = left * 1000)
    on.exit(set_curl(handle$curl, timeout_ms = timeout * 1000))
    result <- attempt_request(request, connection, handle, key)
    failure <- attr(result, "unread")
    if (!inherits(failure, "error")) {
      return(result)
    }
  }
}

# httr's timeout() takes precedence over the client's own.
timeout_of <- function(client) {
  configured <- client_config(client)$options$timeout_ms
  if (is.null(configured)) client$timeout else configured / 1000
}

# Raises the error of an attempt that this side stopped: a too large answer or an interrupt.
raise_own_stop <- function(client, reason, call) {
  if (client$state$too_large) {
    abort_too_large(base = client$remote_base, call = call)
  }
  if (grepl("aborted by (an application )?callback|Callback aborted", reason)) {
    rlang::interrupt()
  }
}

# Whether the user was asked and a server was started, at the first request of a client if nothing
# listens at its address. Only clients of create_GymClient() ask. The function that asks belongs to
# an upper layer and is registered by .onLoad().
prompted_server_starts <- function(client, reached, call) {
  state <- client$state
  prompts <- !reached && isTRUE(state$may_prompt)
  state$may_prompt <- FALSE
  prompts && the_session$prompt_for_server(client, call)
}

#' Decide whether and when to make a request again
#'
#' A request that curl refuses can always be repeated if curl has not asked for the body. A busy
#' server says when to ask again, but a single request does not wait for that.
#' @param outcome The connection's error, or the response.
#' @param attempt The number of attempts made.
#' @param unsent Whether nothing was sent, as far as is known.
#' @return The seconds to wait, `NULL` to give up.
#' @noRd
pause_before_next <- function(request, outcome, attempt, unsent = FALSE) {
  if (!inherits(outcome, "error")) {
    return(seconds_to_wait(outcome))
  }
  reason <- conditionMessage(outcome)
  repeatable <- request$repeatable
  refused <- curl_refused(reason)
  again <- if (refused) repeatable || unsent else repeatable && connection_broke(reason)
  if (again && attempt < max_attempts) if (refused) 0 else 0.1 * attempt
}

# A busy server says when to ask again.
seconds_to_wait <- function(response) {
  if (response$status_code == 429L) {
    header <- curl::parse_headers_list(response$headers)[["retry-after"]]
    seconds <- suppressWarnings(as.numeric(header %||% NA))
    if (is_number(seconds) && seconds >= 0) min(seconds, 60)
  }
}

# libcurl's messages for a lost connection, as opposed to one that could not be made or a timeout.
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

# The message of curl_fetch_memory() when its pool refuses the handle, see replace_handle(). Nothing
# was sent then. But the message is the same if waiting in the pool fails, which may be later.
curl_refused <- function(reason) {
  grepl("Failed initialization", reason, fixed = TRUE)
}

# A response as it is, or a connection's error if the connection ended within the header: libcurl
# takes that for an answer without content.
whole_response <- function(response) {
  end <- as.raw(c(0x0d, 0x0a, 0x0d, 0x0a))
  cut <- !inherits(response, "error") && !length(response$content) &&
    !identical(utils::tail(response$headers, 4L), end)
  if (cut) simpleError("Connection died within the header of the answer") else response
}
