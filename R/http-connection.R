# A client's line to its server: keys, curl's handles, what they send and take.

# What a client holds besides its address: its line to the server and what it
# knows of the server's instances. Made anew when the client finds itself in
# another process or restored from a file, where a line is void and its key
# belongs to the original.
connection <- function(client) {
  state <- client$state
  if (!identical(state$session, the_session) || state$pid != Sys.getpid()) {
    line <- open_line(client)
    suspendInterrupts({
      state$line <- line
      state$instances <- new.env(parent = emptyenv())
      state$creations <- new_numbers()
      state$to_close <- character()
      state$layouts <- new.env(parent = emptyenv())
      state$pid <- Sys.getpid()
      state$session <- the_session
    })
  }
  state
}

# The line that a call may use. R may run a finalizer at any time, also while curl
# waits for an answer, and a finalizer may close an environment: a call inside
# another one gets a line of its own.
free_line <- function(client) {
  line <- connection(client)$line
  while (line$busy) {
    if (is.null(line$inner)) {
      line$inner <- open_line(client, new_numbers(), fetch_aside)
    }
    line <- line$inner
  }
  line
}

# The key and number of the last call that must not be done twice, the body under way,
# and the channels that were opened so far.
open_line <- function(client, numbers = process_numbers(client), fetch = curl::curl_fetch_memory) {
  line <- new.env(parent = emptyenv())
  line$numbers <- numbers
  line$fetch <- fetch
  line$busy <- FALSE
  line$body <- raw()
  line$sent <- 0L
  line$channels <- new.env(parent = emptyenv())
  line
}

# All clients of one server in one process share a key: an instance takes a limited number of
# keys, and a script may make a client for each call.
process_numbers <- function(client) {
  place <- paste(client$remote_base, Sys.getpid())
  the_session$numbers[[place]] %||% (the_session$numbers[[place]] <- new_numbers())
}

# A key, and the last number used under it.
new_numbers <- function() {
  numbers <- new.env(parent = emptyenv())
  numbers$key <- new_key()
  numbers$number <- 0
  numbers
}

# As curl_fetch_memory(), which has one engine for all and cannot run inside itself.
fetch_aside <- function(url, handle) {
  pool <- curl::new_pool()
  outcome <- NULL
  curl::handle_setopt(handle, url = url)
  curl::multi_add(
    handle,
    done = function(response) outcome <<- response,
    fail = function(reason) outcome <<- simpleError(reason),
    pool = pool
  )
  curl::multi_run(pool = pool)
  if (inherits(outcome, "error")) stop(outcome)
  outcome
}

# Called by curl when it wants more of the body. Asked for the body a second time
# (curl repeating a call by itself) there is nothing left and curl gives up: only
# send() may repeat a call.
read_body <- function(line, nbytes) {
  if (line$sent == 0L && length(line$body) <= nbytes) {
    line$sent <- length(line$body)
    return(line$body)
  }
  size <- min(nbytes, length(line$body) - line$sent)
  chunk <- line$body[line$sent + seq_len(size)]
  line$sent <- line$sent + size
  chunk
}

json_type <- "application/json"
tensors_type <- "application/x-safetensors"

# What a call sends and takes. Headers and the source of the body are set once for each
# kind, on a curl handle of its own, as setting them costs more than the call.
channel_kinds <- list(
  get = list(post = FALSE, sends = json_type, takes = json_type),
  get_tensors = list(post = FALSE, sends = json_type, takes = tensors_type),
  post = list(post = TRUE, sends = json_type, takes = json_type),
  post_tensors = list(post = TRUE, sends = json_type, takes = tensors_type),
  send_tensors = list(post = TRUE, sends = tensors_type, takes = tensors_type)
)

find_channel <- function(client, line, kind) {
  line$channels[[kind]] %||% (line$channels[[kind]] <- open_channel(client, line, kind))
}

open_channel <- function(client, line, kind) {
  kind <- channel_kinds[[kind]]
  channel <- new.env(parent = emptyenv())
  channel$handle <- open_handle(client, kind$sends, kind$takes)
  channel$body_size <- -1
  channel$kind <- kind
  if (kind$post) {
    curl::handle_setopt(channel$handle, post = TRUE, readfunction = function(nbytes, ...) {
      read_body(line, nbytes)
    })
  }
  channel
}

open_handle <- function(client, sends, takes) {
  handle <- httr::handle(client$remote_base)$handle
  curl::handle_setopt(
    handle,
    connecttimeout_ms = min(10, client$timeout) * 1000,
    timeout_ms = client$timeout * 1000,
    followlocation = FALSE,
    # Thousands of sub-environments come in few pieces.
    buffersize = 2^18
  )
  if (is_loopback(client$remote_base) && is.null(client$config$options$proxy)) {
    # A proxy that the system names would look for the server on its own machine.
    curl::handle_setopt(handle, noproxy = "*")
  }
  curl::handle_setopt(handle, .list = client$config$options)
  bound_answers(handle, client$state)
  # An empty Expect keeps curl from asking for leave before it sends a body.
  headers <- c(
    "Content-Type" = sends, "Accept" = takes, "Expect" = "",
    "User-Agent" = paste0("gym-R/", utils::packageVersion("gym"))
  )
  if (!is.null(client$token)) {
    headers[["Authorization"]] <- paste("Bearer", client$token())
  }
  custom <- client$config$headers
  curl::handle_setheaders(
    handle,
    .list = as.list(c(headers[setdiff(names(headers), names(custom))], custom))
  )
  if (Sys.getpid() != the_session$pid) {
    # curl's open connections belong to the process that was forked: on one of
    # them a child could read an answer meant for its parent or a sibling.
    curl::handle_setopt(handle, fresh_connect = TRUE, forbid_reuse = TRUE)
  }
  handle
}

is_loopback <- function(base) {
  grepl("^https?://(127[.][0-9.]+|localhost|\\[::1\\])(:[0-9]+)?(/|$)", base)
}

# Unlike anything drawn from R's generator this is never the same twice.
new_key <- function() {
  the_session$keys <- (the_session$keys %||% 0) + 1
  rlang::hash(list(
    Sys.info()[["nodename"]], Sys.getpid(), as.numeric(Sys.time()), tempfile(""), the_session$keys
  ))
}
