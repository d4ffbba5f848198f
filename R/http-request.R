# Requests: send_request() sends one, perform_several() sends several at a time.

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
post_answer <- function(client, route, fields = NULL, key = NULL, repeatable = !is.null(key),
                        call = rlang::caller_env()) {
  response <- send_request(
    client, route, "POST", json_body(fields, key), repeatable = repeatable, call = call
  )
  read_answer(response, "POST", call)
}

# Sends a GET and reads its answer.
get_answer <- function(client, route, takes_tensors = FALSE, call = rlang::caller_env()) {
  accepts <- if (takes_tensors) accepted_tensors else json_type
  response <- send_request(client, route, "GET", accepts = accepts, call = call)
  read_answer(response, "GET", call)
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
    if (outcome$status_code == 429L) {
      header <- curl::parse_headers_list(outcome$headers)[["retry-after"]]
      seconds <- suppressWarnings(as.numeric(header %||% NA))
      if (is_number(seconds) && seconds >= 0) min(seconds, 60)
    }
  } else if (connection_broke(conditionMessage(outcome)) && attempt < max_attempts) {
    0.1 * attempt
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

# Several at a time ------------------------------------------------------------------------

#' Send a POST several times, some at the same time
#'
#' While the server works on one, R reads the answer to another. When the call ends, also by an
#' interrupt or an error, the open connections are dropped. This tells the server that nobody wants
#' their answers.
#'
#' @param next_content A function that returns the next message, a list with its `body`; `NULL` if
#'   there is nothing to send now.
#' @param received A function of the message, its response and the seconds that it took. It is
#'   called once for each, in the order of the answers, and returns whether to end.
#' @param sends The type of the bodies.
#' @param at_once The largest number of open requests.
#' @noRd
perform_several <- function(client, route, next_content, received, sends = tensors_type,
                            at_once = 2L, call = rlang::caller_env()) {
  home <- client_state(client)$home
  # It keeps its connections from call to call.
  home$pool <- home$pool %||% curl::new_pool()
  several <- rlang::env(
    client = client, url = paste0(client$remote_base, route), sends = sends, call = call,
    pool = home$pool, under_way = list()
  )
  on.exit(for (one in several$under_way) {
    if (!is.null(one$line)) curl::multi_cancel(one$line$handle)
  })
  repeat {
    while (length(several$under_way) < at_once && !is.null(content <- next_content())) {
      one <- rlang::env(content = content, line = NULL, outcome = NULL, attempt = 1L)
      one$sent <- one$heard <- one$not_before <- now()
      several$under_way <- c(several$under_way, list(one))
    }
    if (!length(several$under_way)) {
      return(invisible())
    }
    for (one in several$under_way) {
      if (is.null(one$line) && one$not_before <= now()) send_one(one, several)
    }
    await_outcomes(several)
    for (one in Filter(function(one) !is.null(one$outcome), several$under_way)) {
      response <- take_response(one, several)
      if (is.null(response)) next
      several$under_way <- Filter(function(other) !identical(other, one), several$under_way)
      if (isTRUE(received(one$content, response, now() - one$sent))) {
        return(invisible())
      }
    }
  }
}

send_one <- function(one, several) {
  line <- new_line(several$client)
  # After `timeout`, await_outcomes() asks whether the server still works.
  curl::handle_setopt(line$handle, timeout_ms = 0, tcp_keepalive = TRUE)
  set_line(line, "POST", one$content$body, several$sends, accepted_tensors)
  one$sent <- one$heard <- now()
  suspendInterrupts({
    start_request(line, several$url, several$pool, function(outcome) one$outcome <- outcome)
    one$line <- line
  })
}

# Lets curl do what it can do at once and then waits for more. curl would wait for whole seconds,
# using a core that the server needs.
await_outcomes <- function(several) {
  client <- several$client
  client$state$too_large <- FALSE
  suspendInterrupts({
    curl::multi_run(timeout = 0, pool = several$pool)
    for (one in several$under_way) raise_own_stop(one$outcome, client, several$call)
  })
  for (one in several$under_way) {
    if (!is.null(one$outcome)) return(invisible())
  }
  files <- curl::multi_fdset(several$pool)
  if (length(files$reads) || length(files$writes)) {
    # At most a tenth of a second.
    processx::poll(list(processx::curl_fds(files)), 100)
  } else {
    # While curl connects, or all requests wait to be sent again.
    Sys.sleep(0.002)
  }
  # A request may take long, but a working server answers another one.
  for (one in several$under_way) {
    if (is.null(one$outcome) && now() - one$heard > timeout_of(client)) {
      get_answer(client, "/v1/health/", call = several$call)
      one$heard <- now()
    }
  }
}

#' Take the response to a finished request
#' @return The response; `NULL` if the request is to be sent again.
#' @noRd
take_response <- function(one, several) {
  outcome <- whole_response(one$outcome)
  one$outcome <- one$line <- NULL
  pause <- pause_before_next(outcome, one$attempt)
  if (!is.null(pause)) {
    one$attempt <- one$attempt + inherits(outcome, "error")
    one$not_before <- now() + pause
    return(NULL)
  }
  if (inherits(outcome, "error")) {
    abort_connection(several$client$remote_base, conditionMessage(outcome), several$call)
  }
  outcome
}
