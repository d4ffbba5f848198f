# Several requests at a time: while the server works on one, R reads the answer to another. When the
# call ends, also by an interrupt or an error, the open connections are dropped, which tells the
# server that nobody wants their answers.

#' Perform a request several times, some at the same time
#'
#' @param request A POST from [prepare_request()].
#' @param next_content A function that returns the next message, a list whose `body` is the
#'   request's content; `NULL` if there is nothing to send now.
#' @param received A function of the message, its response with the parsed `answer`, and the seconds
#'   that it took. It is called once for each, in the order of the answers, and returns whether to
#'   end.
#' @param at_once The largest number of open requests.
#' @noRd
perform_several <- function(request, next_content, received, at_once = 2L,
                            call = rlang::caller_env()) {
  state <- client_state(request$client)
  # The client's pool and its idle handles, which keep their connections from call to call.
  line <- state$line %||% (state$line <- rlang::env(pool = curl::new_pool(), idle = list()))
  several <- rlang::env(
    request = request, client = request$client, call = call, line = line, under_way = list()
  )
  on.exit(suspendInterrupts(for (one in several$under_way) {
    if (!is.null(one$handle)) {
      curl::multi_cancel(one$handle)
      free_handle(one, several)
    }
  }))
  repeat {
    while (length(several$under_way) < at_once && !is.null(content <- next_content())) {
      one <- rlang::env(
        content = content, handle = NULL, outcome = NULL, attempt = 1L, not_before = 0, heard = 0,
        sent = 0
      )
      several$under_way <- c(several$under_way, list(one))
    }
    if (!length(several$under_way)) break
    for (one in several$under_way) {
      if (is.null(one$handle) && one$not_before <= now()) send_one(one, several)
    }
    await_outcomes(several)
    if (hand_over(several, received)) break
  }
}

# Passes on the responses that have arrived. Returns whether to end.
hand_over <- function(several, received) {
  for (one in Filter(function(one) !is.null(one$outcome), several$under_way)) {
    response <- take_response(one, several)
    if (!is.null(response)) {
      several$under_way <- Filter(function(other) !identical(other, one), several$under_way)
      if (isTRUE(received(one$content, response, now() - one$sent))) {
        return(TRUE)
      }
    }
  }
  FALSE
}

send_one <- function(one, several) {
  request <- several$request
  idle <- several$line$idle[[request$kind]]
  if (length(idle)) {
    several$line$idle[[request$kind]] <- idle[-1L]
    handle <- idle[[1L]]
  } else {
    handle <- new_handle(several$client, request$kind)
    # After `timeout`, check_silent() asks whether the server still works.
    set_curl(handle, timeout_ms = 0, tcp_keepalive = TRUE)
  }
  one$sent <- one$heard <- now()
  suspendInterrupts({
    start_post(
      handle, request$url, request$body(one$content$body, NULL), several$line$pool,
      done = function(response) one$outcome <- response,
      fail = function(reason) one$outcome <- simpleError(reason)
    )
    one$handle <- handle
  })
}

# Adds a POST to a curl pool.
start_post <- function(handle, url, body, pool, done, fail) {
  set_curl(handle, url = url, postfieldsize = length(body), postfields = body)
  curl::multi_add(handle, done = done, fail = fail, pool = pool)
}

free_handle <- function(one, several) {
  kind <- several$request$kind
  several$line$idle[[kind]] <- c(several$line$idle[[kind]], list(one$handle))
  one$handle <- NULL
}

# Lets curl do what it can do at once and then waits for more. curl would wait for whole seconds,
# using a core that the server needs.
await_outcomes <- function(several) {
  pool <- several$line$pool
  state <- several$client$state
  state$too_large <- FALSE
  # Newer versions of curl signal an interrupt if an answer was stopped because of its size, which R
  # handles some moments later.
  tryCatch(
    {
      suspendInterrupts(curl::multi_run(timeout = 0, pool = pool))
      if (state$too_large) Sys.sleep(0.05)
    },
    interrupt = function(cnd) if (!state$too_large) rlang::interrupt()
  )
  if (state$too_large) {
    abort_too_large(base = several$client$remote_base, call = several$call)
  }
  for (one in several$under_way) {
    if (!is.null(one$outcome)) return(invisible())
  }
  files <- curl::multi_fdset(pool)
  if (length(files$reads) || length(files$writes)) {
    # At most a tenth of a second.
    processx::poll(list(processx::curl_fds(files)), 100)
  } else {
    # While curl connects, or all requests wait to be sent again.
    Sys.sleep(0.002)
  }
  check_silent(several)
}

# A request may take long, but a working server answers another one.
check_silent <- function(several) {
  for (one in several$under_way) {
    if (is.null(one$outcome) && now() - one$heard > timeout_of(several$client)) {
      get_answer(several$client, "/v1/health/", call = several$call)
      one$heard <- now()
    }
  }
}

#' Take the response to a finished request
#' @return The response, with its parsed `answer`; `NULL` if the request is to be sent again.
#' @noRd
take_response <- function(one, several) {
  outcome <- whole_response(one$outcome)
  one$outcome <- NULL
  free_handle(one, several)
  pause <- pause_before_next(several$request, outcome, one$attempt)
  if (inherits(outcome, "error")) {
    if (is.null(pause)) {
      abort_connection(several$client$remote_base, conditionMessage(outcome), several$call)
    }
    one$attempt <- one$attempt + 1L
  }
  if (is.null(pause)) {
    return(with_answer(outcome))
  }
  one$not_before <- now() + pause
  NULL
}
