# Requests: send_request() sends one, perform_several() sends several at a time.

#' Send a request and wait for the response
#'
#' @param route The path, after the client's address.
#' @param body A raw vector, for a POST.
#' @param sends,accepts The types of the body and of the answer.
#' @param repeatable Whether it may be sent again after the connection broke. It may if the server
#'   recognises it by its idempotency key, or if doing it twice changes nothing.
#' @return As [curl::curl_fetch_memory()], for any status.
#' @noRd
send_request <- function(client, route, method = "POST", body = raw(), sends = json_type,
                         accepts = json_type, repeatable = method == "GET",
                         call = rlang::caller_env()) {
  # The body may be computed by another request, as in env_step(x, id, env_action_space_sample(x,
  # id)). Do that request first.
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

# Sends a POST and reads its answer. With an idempotency key, the server does it only once.
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
#' @return A raw vector. Blanks at its end give most bodies of a route the same length, because
#'   setting the length in curl takes half as long as a request.
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
#' A busy server (status 429) says when to ask again. Only requests of [perform_several()] wait for
#' that.
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

# Whether libcurl's message says that a connection broke. A connection that could not be made, or a
# timeout, is something else.
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

# If nothing listens at a client's address at its first request, asks the user whether to start a
# server there. Returns whether one was started. Only clients of create_GymClient() ask. The
# function that asks is in an upper layer; .onLoad() registers it.
prompted_server_starts <- function(client, reached, call) {
  state <- client$state
  prompts <- !reached && isTRUE(state$may_prompt)
  state$may_prompt <- FALSE
  prompts && the_session$prompt_for_server(client, call)
}

# Several at a time ------------------------------------------------------------------------

#' Send a POST several times, some at the same time
#'
#' While the server works on one request, R reads the answer to another. At the end, also after an
#' interrupt or an error, this closes connections with open requests, which tells the server that
#' nobody wants the answers.
#'
#' @param next_content A function that returns the next message, a list with its `body`; `NULL` if
#'   there is nothing to send now.
#' @param received A function of the message, its response and the seconds that it took. It is
#'   called once for each response, in the order in which they arrive, and returns whether to stop.
#' @param sends The type of the bodies.
#' @param at_once The largest number of open requests.
#' @noRd
perform_several <- function(client, route, next_content, received, sends = tensors_type,
                            at_once = 2L, call = rlang::caller_env()) {
  home <- client_state(client)$home
  # The pool keeps its connections from call to call.
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

# Lets curl do what it can do at once, and then waits for more data without it. While curl waits, it
# uses a core that the server needs.
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
    # curl is still connecting, or all requests wait to be sent again.
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
