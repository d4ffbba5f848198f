# The attempts at a request, and when there is another one.

# `received` is what came of a first attempt that was made elsewhere: a response, or the
# connection's error.
fetch <- function(client, connection, handle, route, key, repeatable, call, received = NULL) {
  url <- paste0(client$remote_base, route)
  started <- proc.time()[["elapsed"]] - time_taken(handle$curl, received)
  attempt <- 1L
  reached <- FALSE
  state <- client$state
  repeat {
    response <- attempt_request(client, connection, handle$curl, url, key, received)
    received <- NULL
    if (!inherits(response, "error")) {
      state$may_prompt <- FALSE
      return(response)
    }
    reason <- conditionMessage(response)
    raise_own_stop(client, reason, call)
    reached <- reached | curl::handle_data(handle$curl)$times[["pretransfer"]] > 0
    left <- timeout_of(client) - (proc.time()[["elapsed"]] - started) - 0.1 * attempt
    refused <- curl_refused(reason)
    if (refused) {
      handle <- replace_handle(client, connection, handle)
    }
    again <- attempt < max_attempts && left > 0 && may_repeat(connection, repeatable, reason)
    if (!again && prompted_server_starts(client, reached, call)) {
      return(fetch(client, connection, handle, route, key, repeatable, call))
    }
    if (!again) {
      abort_connection(client$remote_base, reason, call, reached)
    }
    if (!refused) Sys.sleep(0.1 * attempt)
    # All attempts together may take as long as one request.
    set_curl(handle$curl, timeout_ms = left * 1000)
    on.exit(set_curl(handle$curl, timeout_ms = timeout_of(client) * 1000))
    attempt <- attempt + 1L
  }
}

# How many seconds a first attempt has taken.
time_taken <- function(handle, received) {
  if (is.null(received)) 0 else curl::handle_data(handle)$times[["total"]]
}

# Raises what ended an attempt from this side: the answer was too large, or the user interrupted.
raise_own_stop <- function(client, reason, call) {
  if (client$state$too_large) {
    abort_too_large(base = client$remote_base, call = call)
  }
  if (grepl("aborted by (an application )?callback|Callback aborted", reason)) {
    rlang::interrupt()
  }
}

# Whether the user was asked and had a server started, at the first request of a client that found
# nothing listening at its address. Only clients of create_GymClient() ask. The function that asks
# belongs to an upper floor and is registered by .onLoad().
prompted_server_starts <- function(client, reached, call) {
  state <- client$state
  prompts <- !reached && isTRUE(state$may_prompt)
  state$may_prompt <- FALSE
  prompts && the_session$prompt_for_server(client, call)
}

# httr's timeout() takes precedence over the client's own.
timeout_of <- function(client) {
  configured <- client_config(client)$options$timeout_ms
  if (is.null(configured)) client$timeout else configured / 1000
}

# Makes one attempt, if nothing was `received` yet. Returns the response with its answer parsed, or
# the connection's error.
attempt_request <- function(client, connection, handle, url, key, received = NULL) {
  if (inherits(received, "error")) {
    return(received)
  }
  response <- NULL
  problem <- tryCatch(
    {
      fetched <- received %||% fetch_once(client$state, connection, handle, url)
      if (ends_in_header(fetched)) {
        stop("Connection died within the header of the answer")
      }
      response <- fetched
      response$answer <- parsed_body(response, client$state$layouts, key)
      NULL
    },
    error = identity
  )
  if (is.null(response)) {
    return(problem)
  }
  if (inherits(problem, "gym_error")) {
    # It says why the answer cannot be read.
    rlang::cnd_signal(problem)
  }
  response
}

fetch_once <- function(state, connection, handle, url) {
  connection$sent <- 0L
  state$too_large <- FALSE
  withCallingHandlers(
    connection$fetch(url, handle),
    # Newer versions of curl signal an interrupt when an answer was stopped for its size.
    interrupt = function(cnd) if (state$too_large) stop("Too large")
  )
}

# libcurl takes the end of the connection there for the end of an answer without content.
ends_in_header <- function(response) {
  if (length(response$content)) {
    return(FALSE)
  }
  end <- as.raw(c(0x0d, 0x0a, 0x0d, 0x0a))
  !identical(utils::tail(response$headers, 4L), end)
}

max_attempts <- 4L

# What curl refuses may be repeated in any case as long as it has not asked for the body.
may_repeat <- function(connection, repeatable, reason) {
  if (curl_refused(reason)) {
    repeatable || connection$sent == 0L
  } else {
    repeatable && connection_broke(reason)
  }
}

# What libcurl says when an open connection was lost, as opposed to one that could not be made or
# an answer that took too long.
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

# What curl_fetch_memory() says when its pool refuses the handle, see replace_handle(). Nothing was
# sent then. It says the same, though, when waiting in the pool fails, and that may be later.
curl_refused <- function(reason) {
  grepl("Failed initialization", reason, fixed = TRUE)
}
