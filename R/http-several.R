# Requests of which several are under way at once: while the server works on one, R reads the answer
# to another. They change nothing on the server, so that one whose connection broke is sent again.
# When the call ends, by an interrupt or an error, too, the connections of those under way are
# dropped, by which the server knows that nobody wants their answers.

#' Send requests, several at once
#'
#' @param next_request A function that returns the next request, a list with `body`, raw; `NULL`
#'   when there is none for now.
#' @param received A function of a request, its response, as [send()] returns it, and the seconds
#'   that it took. It is called once for each request, in the order in which answers come, and
#'   returns whether to end.
#' @param sends The type of the bodies.
#' @param at_once How many requests are under way at most.
#' @noRd
send_several <- function(client, route, next_request, received, sends = tensors_type,
                         at_once = 2L, call = rlang::caller_env()) {
  crew <- rlang::env(
    client = client, url = paste0(client$remote_base, route), sends = sends, call = call,
    line = several_line(client), under_way = list()
  )
  on.exit(suspendInterrupts(lapply(crew$under_way, drop_request, crew = crew)))
  repeat {
    take_requests(crew, next_request, at_once)
    if (!length(crew$under_way)) break
    launch_waiting(crew)
    await_answers(crew)
    if (take_answers(crew, received)) break
  }
}

take_requests <- function(crew, next_request, at_once) {
  while (length(crew$under_way) < at_once && !is.null(request <- next_request())) {
    crew$under_way <- c(crew$under_way, list(new_under_way(request)))
  }
}

# Returns whether to end.
take_answers <- function(crew, received) {
  for (one in Filter(has_outcome, crew$under_way)) {
    response <- settle(crew, one)
    if (!is.null(response)) {
      crew$under_way <- Filter(function(other) !identical(other, one), crew$under_way)
      if (isTRUE(received(one$request, response, now() - one$launched))) {
        return(TRUE)
      }
    }
  }
  FALSE
}

has_outcome <- function(one) !is.null(one$outcome)

now <- function() proc.time()[["elapsed"]]

# The client's pool and its idle handles, which keep their connections from call to call.
several_line <- function(client) {
  state <- client_state(client)
  config <- getOption("httr_config")
  if (is.null(state$several) || !identical(state$several$config, config)) {
    state$several <- rlang::env(
      pool = curl::new_pool(), idle = list(), config = config,
      limits = new.env(parent = emptyenv())
    )
  }
  state$several
}

new_under_way <- function(request) {
  rlang::env(
    request = request, handle = NULL, outcome = NULL, attempt = 1L, not_before = 0, heard = 0,
    launched = 0
  )
}

# Sends what is not sent yet, or is to be sent again.
launch_waiting <- function(crew) {
  for (one in crew$under_way) {
    if (is.null(one$handle) && one$not_before <= now()) launch_request(crew, one)
  }
}

launch_request <- function(crew, one) {
  line <- crew$line
  handle <- take_handle(crew)
  set_curl(
    handle, url = crew$url, postfieldsize = length(one$request$body),
    postfields = one$request$body
  )
  line$limits$too_large <- FALSE
  one$launched <- one$heard <- now()
  suspendInterrupts({
    curl::multi_add(
      handle, done = function(response) one$outcome <- response,
      fail = function(reason) one$outcome <- simpleError(reason), pool = line$pool
    )
    one$handle <- handle
  })
}

take_handle <- function(crew) {
  line <- crew$line
  idle <- line$idle[[crew$sends]]
  if (length(idle)) {
    handle <- idle[[1L]]
    line$idle[[crew$sends]] <- idle[-1L]
  } else {
    accepts <- if (crew$sends == json_type) json_type else accepted_tensors
    handle <- new_handle(crew$client, crew$sends, accepts)
    # Whether the server still works is asked after `timeout`, see check_silent().
    set_curl(handle, post = TRUE, timeout_ms = 0, tcp_keepalive = TRUE)
    limit_answer_size(handle, line$limits)
  }
  handle
}

free_handle <- function(crew, one) {
  crew$line$idle[[crew$sends]] <- c(crew$line$idle[[crew$sends]], list(one$handle))
  one$handle <- NULL
}

drop_request <- function(one, crew) {
  if (!is.null(one$handle)) {
    curl::multi_cancel(one$handle)
    free_handle(crew, one)
  }
}

# Lets curl do what it can do at once, and then waits until there is more. curl would wait for whole
# seconds, and use up a core that the server needs.
await_answers <- function(crew) {
  pool <- crew$line$pool
  let_curl_work(pool, crew$line$limits)
  if (!any(vapply(crew$under_way, has_outcome, NA))) {
    wait_for_pool(pool)
    check_silent(crew)
  }
}

# Newer versions of curl signal an interrupt when an answer was stopped for its size, which R takes
# some moments later.
let_curl_work <- function(pool, limits) {
  tryCatch(
    {
      suspendInterrupts(curl::multi_run(timeout = 0, pool = pool))
      if (limits$too_large) Sys.sleep(0.05)
    },
    interrupt = function(cnd) if (!limits$too_large) rlang::interrupt()
  )
}

# At most a tenth of a second.
wait_for_pool <- function(pool) {
  files <- curl::multi_fdset(pool)
  if (length(files$reads) || length(files$writes)) {
    processx::poll(list(processx::curl_fds(files)), 100)
  } else {
    # While curl connects, or all requests wait to be sent again.
    Sys.sleep(0.002)
  }
}

# However long a request takes, a server that works answers another one.
check_silent <- function(crew) {
  for (one in crew$under_way) {
    if (is.null(one$outcome) && now() - one$heard > timeout_of(crew$client)) {
      get_answer(crew$client, "/v1/health/", call = crew$call)
      one$heard <- now()
    }
  }
}

#' Decide what becomes of a request that has ended
#' @return The response, with its `answer` parsed; `NULL` where the request is to be sent again.
#' @noRd
settle <- function(crew, one) {
  outcome <- one$outcome
  one$outcome <- NULL
  free_handle(crew, one)
  if (crew$line$limits$too_large) {
    abort_too_large(base = crew$client$remote_base, call = crew$call)
  }
  if (!inherits(outcome, "error") && ends_in_header(outcome)) {
    outcome <- simpleError("Connection died within the header of the answer")
  }
  if (inherits(outcome, "error")) {
    return(send_again(crew, one, conditionMessage(outcome)))
  }
  seconds <- seconds_to_wait(outcome)
  if (!is.null(seconds)) {
    one$not_before <- now() + seconds
    return(NULL)
  }
  outcome$answer <- tryCatch(
    parsed_body(outcome), gym_error = rlang::cnd_signal, error = function(cnd) NULL
  )
  outcome
}

send_again <- function(crew, one, reason) {
  if (!connection_broke(reason) || one$attempt >= max_attempts) {
    abort_connection(crew$client$remote_base, reason, crew$call)
  }
  one$not_before <- now() + 0.1 * one$attempt
  one$attempt <- one$attempt + 1L
  NULL
}

# A server that has too much to do says when to ask again.
seconds_to_wait <- function(response) {
  if (response$status_code == 429L) {
    header <- curl::parse_headers_list(response$headers)[["retry-after"]]
    seconds <- suppressWarnings(as.numeric(header %||% NA))
    if (is_number(seconds) && seconds >= 0) min(seconds, 60)
  }
}

#' Make a POST that changes nothing, and read its answer
#' @param fields JSON texts of the body's fields, named.
#' @noRd
post_repeatable <- function(client, route, fields, call = rlang::caller_env()) {
  request <- list(body = charToRaw(json_object(fields)))
  answer <- NULL
  send_several(
    client, route,
    next_request = function() {
      sent <- request
      request <<- NULL
      sent
    },
    received = function(request, response, seconds) {
      answer <<- read_answer(response, "POST", call)
      TRUE
    },
    sends = json_type, call = call
  )
  answer
}
