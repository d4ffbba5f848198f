# The attempts at a call, and when there is another.

fetch <- function(client, line, channel, route, request, repeatable, call) {
  handle <- channel$handle
  url <- paste0(client$remote_base, route)
  started <- proc.time()[["elapsed"]]
  attempt <- 1L
  reached <- FALSE
  state <- client$state
  state$overlong <- FALSE
  repeat {
    response <- exchange(client, line, handle, url, request)
    if (!inherits(response, "error")) {
      return(response)
    }
    reason <- conditionMessage(response)
    if (state$overlong) {
      abort_overlong(base = client$remote_base, call = call)
    }
    if (grepl("aborted by an application callback", reason, fixed = TRUE)) {
      rlang::interrupt()
    }
    reached <- reached | curl::handle_data(handle)$times[["pretransfer"]] > 0
    left <- patience(client) - (proc.time()[["elapsed"]] - started) - 0.1 * attempt
    again <- repeatable && attempt < max_attempts && left > 0 && connection_broke(reason)
    if (!again) {
      abort_connection(client$remote_base, reason, call, reached)
    }
    Sys.sleep(0.1 * attempt)
    # All attempts together may take as long as one call.
    curl::handle_setopt(handle, timeout_ms = left * 1000)
    on.exit(curl::handle_setopt(handle, timeout_ms = patience(client) * 1000))
    attempt <- attempt + 1L
  }
}

# httr's timeout() goes before the client's own.
patience <- function(client) {
  own <- client$config$options$timeout_ms
  if (is.null(own)) client$timeout else own / 1000
}

# One attempt: the response with its answer parsed, or the error of the connection.
exchange <- function(client, line, handle, url, request) {
  line$sent <- 0L
  response <- NULL
  problem <- tryCatch(
    {
      fetched <- withCallingHandlers(
        line$fetch(url, handle),
        # So newer versions of curl tell that an answer was stopped for its size.
        interrupt = function(cnd) if (client$state$overlong) stop("Too large")
      )
      if (ends_in_header(fetched)) {
        stop("Connection died within the header of the answer")
      }
      response <- fetched
      response$answer <- parsed_body(response, client$state$layouts, request)
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

# libcurl takes the end of the connection there for the end of an answer without content.
ends_in_header <- function(response) {
  if (length(response$content)) {
    return(FALSE)
  }
  end <- as.raw(c(0x0d, 0x0a, 0x0d, 0x0a))
  !identical(utils::tail(response$headers, 4L), end)
}

max_attempts <- 4L

# What libcurl says when a connection that stood went away, as opposed to one that
# could not be made or an answer that took too long.
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
