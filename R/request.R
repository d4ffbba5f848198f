# The connection ----------------------------------------------------------------

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
      line$inner <- open_line(client, fetch_aside)
    }
    line <- line$inner
  }
  line
}

# The key and number of the last call that must not be done twice, the body under way,
# and the channels that were opened so far.
open_line <- function(client, fetch = curl::curl_fetch_memory) {
  line <- new_numbers()
  line$fetch <- fetch
  line$busy <- FALSE
  line$body <- raw()
  line$sent <- 0L
  line$channels <- new.env(parent = emptyenv())
  line
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
    # Thousands of lanes come in few pieces.
    buffersize = 2^18
  )
  if (is_loopback(client$remote_base) && is.null(client$config$options$proxy)) {
    # A proxy that the system names would look for the server on its own machine.
    curl::handle_setopt(handle, noproxy = "*")
  }
  curl::handle_setopt(handle, .list = client$config$options)
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

# Requests ----------------------------------------------------------------------

#' Send a request
#'
#' The one function that speaks HTTP. A GET whose connection broke is sent again,
#' and so is a POST that is done `once`, under the number by which the server
#' knows the repeat.
#' @param fields JSON texts of the fields of a POST's body, named; `NULL` for a GET.
#' @param tensors Tensors for a body that is not JSON, see [write_tensors()].
#' @param take_tensors Whether the answer should come as tensors.
#' @param request The key and number of a POST that is done once; by default the line's next.
#' @return What [curl::curl_fetch_memory()] returns, whatever the status, with the
#'   `request` that was sent (its `key` and `number`) and the parsed `answer`, `NULL`
#'   for none or one that cannot be read.
#' @noRd
send <- function(client, route, fields = NULL, tensors = NULL, take_tensors = FALSE,
                 once = FALSE, request = NULL, call = rlang::caller_env()) {
  # Arguments may hold calls of their own, as in env_reset(x, env_create(x, id)):
  # those come first and have the line for themselves.
  force(route)
  force(fields)
  force(tensors)
  line <- free_line(client)
  line$busy <- TRUE
  on.exit(line$busy <- FALSE)
  channel <- find_channel(client, line, channel_kind(fields, tensors, take_tensors))
  if (once && is.null(request)) {
    request <- next_request(line)
  }
  if (!is.null(fields)) {
    load_body(line, channel, request_body(fields, request, tensors))
  }
  repeatable <- once || is.null(fields)
  response <- fetch(client, line, channel, route, request, repeatable, call)
  response$request <- request
  response
}

channel_kind <- function(fields, tensors, take_tensors) {
  if (!is.null(tensors)) {
    "send_tensors"
  } else if (is.null(fields)) {
    if (take_tensors) "get_tensors" else "get"
  } else {
    if (take_tensors) "post_tensors" else "post"
  }
}

next_request <- function(numbers) {
  numbers$number <- numbers$number + 1
  list(key = numbers$key, number = numbers$number)
}

request_body <- function(fields, request, tensors = NULL) {
  fields <- c(fields, request = request_json(request))
  if (is.null(tensors)) charToRaw(json_object(fields)) else write_tensors(tensors, fields)
}

request_json <- function(request) {
  if (!is.null(request)) {
    sprintf('{"key":"%s","number":%.0f}', request$key, request$number)
  }
}

# curl needs the length of a body beforehand, and setting it costs as much as half a
# call: small bodies are padded with blanks to one length.
load_body <- function(line, channel, bytes) {
  line$body <- padded(bytes, channel$kind)
  size <- length(line$body)
  if (size != channel$body_size) {
    suspendInterrupts({
      curl::handle_setopt(channel$handle, postfieldsize_large = size)
      channel$body_size <- size
    })
  }
}

# Blanks at the end of a JSON text mean nothing.
padded <- function(bytes, kind) {
  padding <- 256L - length(bytes)
  if (padding > 0L && kind$sends == json_type) c(bytes, rep(as.raw(0x20), padding)) else bytes
}

fetch <- function(client, line, channel, route, request, repeatable, call) {
  handle <- channel$handle
  url <- paste0(client$remote_base, route)
  started <- proc.time()[["elapsed"]]
  attempt <- 1L
  reached <- FALSE
  repeat {
    response <- exchange(client, line, handle, url, request)
    if (!inherits(response, "error")) {
      return(response)
    }
    reason <- conditionMessage(response)
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
      fetched <- line$fetch(url, handle)
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

# Make a call that the server carries out exactly once, and read its answer.
post_once <- function(client, route, fields = NULL, tensors = NULL, take_tensors = FALSE,
                      request = NULL, call = rlang::caller_env()) {
  fields <- fields %||% character()
  response <- send(client, route, fields, tensors, take_tensors, TRUE, request, call)
  read_answer(response, "POST", call)
}

# Make any other call, and read its answer.
get_answer <- function(client, route, take_tensors = FALSE, call = rlang::caller_env()) {
  read_answer(send(client, route, take_tensors = take_tensors, call = call), "GET", call)
}

post_answer <- function(client, route, fields = character(), call = rlang::caller_env()) {
  read_answer(send(client, route, fields, call = call), "POST", call)
}

#' Read an answer or raise its error
#' @param response What [send()] returned.
#' @return The parsed answer, `NULL` for an empty one.
#' @noRd
read_answer <- function(response, method, call = rlang::caller_env()) {
  answer <- response$answer
  check_echo(response, answer, call)
  if (response$status_code >= 400L) {
    abort_http(response, method, call)
  }
  if (response$status_code != 204L && is.null(answer)) {
    abort_no_answer(response, call)
  }
  answer
}

# An answer as a list; NULL for an empty one, an error for what is none.
parsed_body <- function(response, layouts = NULL, request = NULL) {
  if (response$status_code == 204L) {
    NULL
  } else if (identical(response$type, tensors_type)) {
    tensors_answer(response$content, layouts, request)
  } else if (identical(response$type, "image/png")) {
    list(png = response$content)
  } else {
    answer <- from_json(rawToChar(response$content))
    if (is.list(answer)) answer
  }
}

# An answer to another call would be worse than none.
check_echo <- function(response, answer, call) {
  sent <- response$request
  if (is.null(sent)) {
    return()
  }
  echo <- if (response$status_code == 204L) echo_in_header(response) else answer$request
  if (!is.null(echo) && !(echo$number == sent$number && identical(echo$key, sent$key))) {
    abort_connection(response$url, "The answer that came belongs to another call.", call)
  }
}

echo_in_header <- function(response) {
  echo <- curl::parse_headers_list(response$headers)[["gym-request"]]
  if (!is.null(echo)) {
    parts <- strsplit(echo, " ", fixed = TRUE)[[1L]]
    list(key = parts[[1L]], number = as.numeric(parts[[2L]]))
  }
}

# An answer of tensors has the fields of the JSON answer that it stands for, and
# beside them the tensors and the texts by their names.
tensors_answer <- function(bytes, layouts, request = NULL) {
  file <- read_tensors(bytes, layouts, if (!is.null(request)) bare_metadata(request))
  if (is.null(file$metadata)) {
    return(list(tensors = file$tensors, info = empty_object, request = request))
  }
  field <- function(name) {
    text <- file$metadata[[name]]
    if (!is.null(text)) from_json(text)
  }
  list(
    tensors = file$tensors,
    texts = field("texts"),
    info = if (identical(file$metadata$info, "{}")) empty_object else field("info"),
    final_lanes = field("final_lanes"),
    request = field("request")
  )
}

# The metadata of an answer that echoes the request and has an empty info.
bare_metadata <- function(request) {
  sprintf(
    '{"info":"{}","request":"{\\"key\\":\\"%s\\",\\"number\\":%.0f}"}}',
    request$key, request$number
  )
}

empty_object <- structure(list(), names = character())
