# Several requests at a time: while the server works on one, R reads the answer to another. When the
# call ends, also by an interrupt or an error, the open connections are dropped, which tells the
# server that nobody wants their answers.

#' Send a POST several times, some at the same time
#'
#' @param next_content A function that returns the next message, a list with its `body`; `NULL` if
#'   there is nothing to send now.
#' @param received A function of the message, its response with the parsed `answer`, and the seconds
#'   that it took. It is called once for each, in the order of the answers, and returns whether to
#'   end.
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
#' @return The response, with its parsed `answer`; `NULL` if the request is to be sent again.
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
  with_answer(outcome)
}
