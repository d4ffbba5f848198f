# What this session has made on servers. It is closed when nobody has it any more: when its
# object was thrown away or a call that made it was interrupted, and at the session's end.

# How long closing may take in all, in seconds, where nobody waits for it.
closing_time <- 2

#' Make an instance, and remember it
#'
#' Creating has a key of its own, under which it can be repeated later: that tells the id of
#' an instance whose answer was lost.
#' @return The instance's id.
#' @noRd
make_instance <- function(x, fields, call) {
  state <- client_state(x)
  key <- next_key(state$creation_keys)
  place <- paste(key$key, key$number)
  outcome <- "lost"
  on.exit(end_creation(state, place, outcome))
  keep_made(place, x, body = padded(request_body(fields, key), handle_kinds$post))
  answer <- withCallingHandlers(
    post_once(x, "/v1/envs/", fields, key = key, call = call),
    gym_error_http = function(cnd) outcome <<- "refused",
    gym_error_connection = function(cnd) if (isFALSE(cnd$reached)) outcome <<- "unsent"
  )
  check_instance_id(answer$instance_id)
  suspendInterrupts({
    note_protocol(state, answer)
    keep_made(made_place(x, answer$instance_id), x, answer$instance_id)
    outcome <- "made"
  })
  answer$instance_id
}

instance_route <- function(instance_id) {
  paste0("/v1/envs/", curl::curl_escape(instance_id), "/")
}

# One whose answer was lost is asked for it when the next is made. Until then its key must
# see no other number.
end_creation <- function(state, place, outcome) {
  if (outcome == "lost") {
    state$creation_keys <- new_idempotency_keys()
    state$to_close <- c(state$to_close, place)
  } else {
    forget_made(place)
  }
}

made_place <- function(x, instance_id) paste(x$remote_base, instance_id)

# `body`: of a creation that has no answer yet.
keep_made <- function(place, x, instance_id = NULL, body = NULL) {
  assign(
    place, list(client = x, pid = Sys.getpid(), instance_id = instance_id, body = body),
    envir = the_session$made
  )
}

forget_made <- function(place) {
  if (exists(place, envir = the_session$made, inherits = FALSE)) {
    rm(list = place, envir = the_session$made)
  }
}

# Of a server that has ended.
forget_made_on <- function(base) {
  places <- ls(the_session$made, all.names = TRUE, sorted = FALSE)
  rm(list = places[startsWith(places, paste0(base, " "))], envir = the_session$made)
}

# Closing --------------------------------------------------------------------------

#' Have an instance closed that nobody has any more
#' @noRd
abandon_instance <- function(x, instance_id) {
  if (!is.null(instance_id)) {
    queue_closing(x, instance_id)
    close_abandoned(x)
  }
}

# All that a finalizer may do: it may run in the middle of a call.
queue_closing <- function(x, instance_id) {
  place <- made_place(x, instance_id)
  if (exists(place, envir = the_session$made, inherits = FALSE)) {
    state <- client_state(x)
    state$to_close <- c(state$to_close, place)
  }
}

#' Close what was abandoned since the last time
#'
#' What cannot be closed in time is tried again at the session's end only, so that a server
#' that hangs delays a call once.
#' @noRd
close_abandoned <- function(x) {
  state <- client_state(x)
  if (length(state$to_close)) {
    places <- state$to_close
    state$to_close <- character()
    close_aside(places, closing_time)
  }
}

# A forked child has what its parent made in its memory, but not to close.
close_session_instances <- function(seconds) {
  places <- ls(the_session$made, all.names = TRUE, sorted = FALSE)
  close_aside(Filter(function(place) !on_own_server(the_session$made[[place]]), places), seconds)
}

# Those end with it.
on_own_server <- function(entry) !is.null(the_session$servers[[entry$client$remote_base]])

#' Close instances, all at once, in a limited time
#'
#' The one place beside [send()] that speaks HTTP: not on a client's line, which may be in the
#' middle of a call, without a repeat, and not one after the other, as each may hang.
#' @param places Where they are in `the_session$made`.
#' @noRd
close_aside <- function(places, seconds) {
  places <- Filter(function(place) is_own_made(the_session$made[[place]]), places)
  if (!length(places)) {
    return(invisible())
  }
  pool <- curl::new_pool()
  on.exit(lapply(curl::multi_list(pool), curl::multi_cancel))
  deadline <- proc.time()[["elapsed"]] + seconds
  post <- function(entry, route, body, done) {
    handle <- aside_handle(entry$client, route, body, deadline - proc.time()[["elapsed"]])
    curl::multi_add(handle, done = done, fail = function(reason) NULL, pool = pool)
  }
  close_place <- function(place) {
    entry <- the_session$made[[place]]
    route <- paste0(instance_route(entry$instance_id), "close/")
    post(entry, route, charToRaw("{}"), function(response) forget_made(place))
  }
  ask_for_id <- function(place) {
    entry <- the_session$made[[place]]
    post(entry, "/v1/envs/", entry$body, function(response) {
      instance_id <- tryCatch(
        string_or_null(parsed_body(response)$instance_id), error = function(cnd) NULL
      )
      forget_made(place)
      if (!is.null(instance_id)) {
        made <- made_place(entry$client, instance_id)
        keep_made(made, entry$client, instance_id)
        close_place(made)
      }
    })
  }
  for (place in places) {
    if (is.null(the_session$made[[place]]$body)) close_place(place) else ask_for_id(place)
  }
  curl::multi_run(timeout = seconds, pool = pool)
  invisible()
}

is_own_made <- function(entry) !is.null(entry) && entry$pid == Sys.getpid()

aside_handle <- function(client, route, body, seconds) {
  handle <- new_handle(client, json_type, json_type)
  curl::handle_setopt(
    handle,
    url = paste0(client$remote_base, route), post = TRUE,
    postfieldsize = length(body), postfields = body,
    timeout_ms = max(1, seconds * 1000), connecttimeout_ms = max(1, seconds * 1000)
  )
  handle
}
