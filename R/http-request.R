# Requests: one function sends them all, except for several at a time.

#' Send a request and wait for the response
#'
#' @param route The path, after the client's address.
#' @param body A raw vector, for a POST.
#' @param sends,accepts The types of the body and of the answer.
#' @param repeatable Whether it may be sent again if its connection broke: the server recognises it
#'   by its idempotency key, or to do it twice changes nothing.
#' @return As [curl::curl_fetch_memory()], for any status.
#' @noRd
send_request <- function(client, route, method = "POST", body = raw(), sends = json_type,
                         accepts = json_type, repeatable = method == "GET",
                         call = rlang::caller_env()) {
  # The body may hold the answer to another request, as in env_step(x, id,
  # env_action_space_sample(x, id)). Make that one first.
  force(body)
  line <- line_of(client)
  line$busy <- TRUE
  on.exit(line$busy <- FALSE)
  set_line(line, method, body, sends, accepts)
  begun <- NULL
  attempt <- 1L
  reached <- FALSE
  repeat {
    response <- fetch(line, paste0(client$remote_base, route), call)
    if (!inherits(response, "error")) {
      client$state$may_prompt <- FALSE
      return(response)
    }
    times <- curl::handle_data(line$handle)$times
    begun <- begun %||% (now() - times[["total"]])
    reached <- reached || times[["pretransfer"]] > 0
    pause <- if (repeatable) pause_before_next(response, attempt)
    if (!is.null(pause) && now() - begun + pause < timeout_of(client)) {
      Sys.sleep(pause)
      attempt <- attempt + 1L
    } else if (prompted_server_starts(client, reached, call)) {
      begun <- now()
      attempt <- 1L
    } else {
      abort_connection(client$remote_base, conditionMessage(response), call, reached)
    }
  }
}

# Sends a POST and reads its answer. With an idempotency key the server does it once.
post_answer <- function(client, route, fields = NULL, key = NULL, body = json_body(fields, key),
                        repeatable = !is.null(key), call = rlang::caller_env()) {
  response <- send_request(client, route, "POST", body, repeatable = repeatable, call = call)
  read_answer(with_answer(response), "POST", call)
}

# Sends a GET and reads its answer.
get_answer <- function(client, route, takes_tensors = FALSE, call = rlang::caller_env()) {
  accepts <- if (takes_tensors) accepted_tensors else json_type
  response <- send_request(client, route, "GET", accepts = accepts, call = call)
  read_answer(with_answer(response), "GET", call)
}

#' Write a body in JSON
#' @param fields JSON texts, named.
#' @param key The idempotency key, a list as [next_key()] returns it.
#' @return A raw vector. It has blanks at its end, so that most bodies of one route have one length:
#'   curl takes as long to set the length as for half a request.
#' @noRd
json_body <- function(fields, key = NULL) {
  request <- if (!is.null(key)) sprintf('{"key":"%s","number":%.0f}', key$key, key$number)
  bytes <- charToRaw(json_object(c(fields, request = request)))
  c(bytes, rep(as.raw(0x20), -length(bytes) %% 64L))
}

# Attempts -------------------------------------------------------------------------------

max_attempts <- 4L

#' Decide whether and when to send a request again
#'
#' A busy server says when to ask again, but a single request does not wait for that.
#' @param outcome The connection's error, or the response.
#' @param attempt The number of attempts made.
#' @return The seconds to wait, `NULL` to give up.
#' @noRd
pause_before_next <- function(outcome, attempt) {
  if (!inherits(outcome, "error")) {
    seconds_to_wait(outcome)
  } else if (connection_broke(conditionMessage(outcome)) && attempt < max_attempts) {
    0.1 * attempt
  }
}

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

# Whether the user was asked and a server was started, at the first request of a client if nothing
# listens at its address. Only clients of create_GymClient() ask. The function that asks belongs to
# an upper layer and is registered by .onLoad().
prompted_server_starts <- function(client, reached, call) {
  state <- client$state
  prompts <- !reached && isTRUE(state$may_prompt)
  state$may_prompt <- FALSE
  prompts && the_session$prompt_for_server(client, call)
}
