# A client's connection to its server, and the session's data about a client: idempotency keys,
# curl's handles, the body of the current request.

# The part of a client besides its address: its connection to the server and what it knows of the
# server's instances. It is made again if the client is in another process or restored from a file:
# the connection is then void, and its idempotency keys belong to the original. The handles are made
# again after httr::set_config() or httr::reset_config().
client_state <- function(client) {
  state <- client$state
  if (!identical(state$session, the_session) || state$pid != Sys.getpid()) {
    # All clients of one server in one process share their keys: the server remembers a limited
    # number for an instance, and a script may make a client for each call.
    place <- paste(client$remote_base, Sys.getpid())
    keys <- the_session$keys[[place]] %||% (the_session$keys[[place]] <- new_idempotency_keys())
    connection <- new_connection(keys, fetch_with_token_of(client))
    suspendInterrupts({
      state$connection <- connection
      state$session_config <- getOption("httr_config")
      state$instances <- new.env(parent = emptyenv())
      state$creation_keys <- new_idempotency_keys()
      state$server <- NULL
      state$to_close <- character()
      state$health <- NULL
      state$line <- NULL
      # The process in which the client was first used.
      state$made_in <- state$made_in %||% state$pid %||% Sys.getpid()
      state$pid <- Sys.getpid()
      state$session <- the_session
    })
  } else if (!identical(state$session_config, getOption("httr_config"))) {
    suspendInterrupts({
      state$connection$handles <- new.env(parent = emptyenv())
      state$connection$inner <- NULL
      state$line <- NULL
      state$session_config <- getOption("httr_config")
    })
  }
  state
}

# Makes a connection: its idempotency keys, the function that performs a request, the current body,
# and its handles.
new_connection <- function(keys, fetch = curl::curl_fetch_memory) {
  connection <- new.env(parent = emptyenv())
  connection$keys <- keys
  connection$fetch <- fetch
  connection$busy <- FALSE
  connection$body <- raw()
  connection$sent <- 0L
  connection$handles <- new.env(parent = emptyenv())
  connection
}

# The connection for a request inside another one. R may run a finalizer at any time, even while
# curl waits for an answer, and a user's finalizer may make a request.
inner_connection <- function(connection) {
  while (connection$busy) {
    if (is.null(connection$inner)) {
      connection$inner <- new_connection(new_idempotency_keys(), fetch_in_own_pool())
    }
    connection <- connection$inner
  }
  connection
}

# The function that performs a client's requests. curl_fetch_memory() has one pool, so clients share
# connections. On a server for each user, a connection belongs to one token: the first token of an
# address uses that pool, and clients with another one have their own.
fetch_with_token_of <- function(client) {
  if (is.null(client$token)) {
    return(curl::curl_fetch_memory)
  }
  digest <- rlang::hash(client$token())
  first <- the_session$token_digests[[client$remote_base]]
  if (is.null(first)) {
    the_session$token_digests[[client$remote_base]] <- digest
  }
  if (identical(first %||% digest, digest)) curl::curl_fetch_memory else fetch_in_own_pool()
}

# Makes a function like curl_fetch_memory() with its own pool. The single pool of
# curl_fetch_memory() cannot run inside itself, and an interrupt can make it unusable. Interrupts
# are delayed until curl returns, which takes up to a second.
fetch_in_own_pool <- function() {
  pool <- curl::new_pool()
  function(url, handle) {
    outcome <- NULL
    on.exit(suspendInterrupts(curl::multi_cancel(handle)))
    suspendInterrupts({
      set_curl(handle, url = url)
      curl::multi_add(
        handle,
        done = function(response) outcome <<- response,
        fail = function(reason) outcome <<- simpleError(reason),
        pool = pool
      )
    })
    repeat {
      state <- suspendInterrupts(curl::multi_run(timeout = 0.1, pool = pool))
      # A delayed interrupt happens here.
      Sys.sleep(0)
      if (!is.null(outcome) || state$pending == 0) break
    }
    if (inherits(outcome, "error")) stop(outcome)
    outcome
  }
}

# Idempotency keys ------------------------------------------------------------------

# A source of idempotency keys, by which the server recognises a repeated request: a random text,
# and the number of the last request.
new_idempotency_keys <- function() {
  keys <- new.env(parent = emptyenv())
  keys$key <- random_key()
  keys$number <- 0
  keys
}

# The idempotency key of the next request, for its field `request`.
next_key <- function(keys) {
  keys$number <- keys$number + 1
  list(key = keys$key, number = keys$number)
}

# Unlike R's generator, this never returns the same text twice.
random_key <- function() {
  the_session$key_count <- (the_session$key_count %||% 0) + 1
  rlang::hash(list(
    Sys.info()[["nodename"]], Sys.getpid(), as.numeric(Sys.time()), tempfile(""),
    the_session$key_count
  ))
}

# Handles ---------------------------------------------------------------------------

json_type <- "application/json"
tensors_type <- "application/x-safetensors"
# The answer of a stream, for a request that repeats its message.
message_type <- "application/x-gym-message"
# With transposed tensors, in R's order. A server that does not know it answers by rows.
column_tensors_type <- "application/x-safetensors; order=column"
accepted_tensors <- paste0(column_tensors_type, ", ", tensors_type, ";q=0.9")

# What a request sends and which answers it accepts. Each kind has its own handle, on which the
# headers and the source of the body are set once: setting them takes longer than the request.
handle_kinds <- list(
  get = list(post = FALSE, sends = json_type, accepts = json_type),
  get_tensors = list(post = FALSE, sends = json_type, accepts = accepted_tensors),
  post = list(post = TRUE, sends = json_type, accepts = json_type),
  post_tensors = list(post = TRUE, sends = json_type, accepts = accepted_tensors),
  send_tensors = list(post = TRUE, sends = tensors_type, accepts = accepted_tensors)
)

# Makes a connection's handle of one kind: curl's handle, and the body length set on it.
add_handle <- function(client, connection, kind) {
  handle <- new.env(parent = emptyenv())
  handle$kind <- kind
  handle$curl <- new_handle(client, kind)
  handle$body_size <- -1
  if (handle_kinds[[kind]]$post) set_curl(handle$curl, readfunction = body_reader(connection))
  connection$handles[[kind]] <- handle
}

# Gives a connection new handles and its own pool, and returns the new handle of the same kind.
#
# R may collect garbage while curl allocates the arguments of our callbacks, and then handle a
# waiting interrupt, which jumps out of libcurl. After that libcurl believes that it is still in a
# callback and refuses every use of curl_fetch_memory()'s pool.
replace_handle <- function(client, connection, handle) {
  connection$fetch <- fetch_in_own_pool()
  connection$handles <- new.env(parent = emptyenv())
  fresh <- add_handle(client, connection, handle$kind)
  if (handle$body_size >= 0) set_body_size(fresh, handle$body_size)
  fresh
}

set_body_size <- function(handle, size) {
  suspendInterrupts({
    set_curl(handle$curl, postfieldsize_large = size)
    handle$body_size <- size
  })
}

# Makes the function from which curl reads the body. If curl repeats a request itself, it asks for
# the body a second time, gets nothing and fails: only repeat_request() may repeat.
body_reader <- function(connection) {
  function(nbytes, ...) {
    if (connection$sent == 0L && length(connection$body) <= nbytes) {
      connection$sent <- length(connection$body)
      return(connection$body)
    }
    size <- min(nbytes, length(connection$body) - connection$sent)
    chunk <- connection$body[connection$sent + seq_len(size)]
    connection$sent <- connection$sent + size
    chunk
  }
}

# A curl handle with the settings of a client, for requests of one kind.
new_handle <- function(client, kind) {
  config <- client_config(client)
  kind <- handle_kinds[[kind]]
  handle <- httr::handle(client$remote_base)$handle
  set_curl(
    handle,
    post = kind$post,
    connecttimeout_ms = min(10, client$timeout) * 1000,
    timeout_ms = client$timeout * 1000,
    followlocation = FALSE,
    # Receive the data of thousands of sub-environments in few pieces.
    buffersize = 2^18
  )
  if (is_loopback(client$remote_base) && is.null(config$options$proxy)) {
    # A system-wide proxy would look for the server on its own machine.
    set_curl(handle, noproxy = "*")
  }
  set_curl(handle, .list = config$options)
  limit_answer_size(handle, client$state)
  # An empty Expect keeps curl from waiting for permission to send a body.
  headers <- c(
    "Content-Type" = kind$sends, "Accept" = kind$accepts, "Expect" = "",
    "User-Agent" = paste0("gym-R/", utils::packageVersion("gym"))
  )
  if (!is.null(client$token)) {
    headers[["Authorization"]] <- paste("Bearer", client$token())
  }
  custom <- config$headers
  curl::handle_setheaders(
    handle,
    .list = as.list(c(headers[setdiff(names(headers), names(custom))], custom))
  )
  if (Sys.getpid() != the_session$pid) {
    # curl's open connections belong to the parent process: a forked child could read an answer for
    # its parent or a sibling from them.
    set_curl(handle, fresh_connect = TRUE, forbid_reuse = TRUE)
  }
  handle
}

#' Set options of a handle
#'
#' Like [curl::handle_setopt()], which fails in a Turkish locale: it applies [tolower()] to all
#' names, and there the small letter of "I" has no dot. So this passes curl's own names.
#' @noRd
set_curl <- function(handle, ..., .list = list()) {
  options <- c(list(...), .list)
  if (is.null(the_session$curl_names)) {
    known <- names(curl::curl_options())
    the_session$curl_names <- stats::setNames(known, gsub("\u0131", "i", known, fixed = TRUE))
  }
  known <- the_session$curl_names[names(options)]
  names(options) <- ifelse(is.na(known), names(options), known)
  curl::handle_setopt(handle, .list = options)
}
