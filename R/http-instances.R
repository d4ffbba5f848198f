# The instances that this session has created on servers, and how they are closed that nobody can
# use any more: when their object was thrown away, when the call that created them was interrupted,
# and when the session ends.
#
# They are registered in `the_session$created`, each under a name, as a list of `client`, `pid` (the
# process that created it), `instance_id`, and `body`, the body of a request to create one that has
# no answer yet (then there is no `instance_id`).

# How many seconds closing may take in all where it was not asked for.
closing_time <- 2

#' Create an instance and register it
#'
#' An instance may be created although its answer is lost, and then nobody knows its id:
#'
#' 1. The request is registered with its body before it is sent.
#' 2. The server creates the instance; an interrupt or a lost connection comes before the answer.
#' 3. `outcome` is still "lost": the request is queued for closing. Further instances are created
#'    under a new idempotency key, so that the old one sees no other number until step 4.
#' 4. When the next instance is created or reset, or instances are listed, or the session ends, the
#'    request is sent again. The server does not create another instance; it answers with the id,
#'    and the instance is closed.
#' @return The instance's id.
#' @noRd
create_and_register <- function(client, fields, call) {
  state <- client_state(client)
  key <- next_key(state$creation_keys)
  name <- paste(key$key, key$number)
  outcome <- "lost"
  on.exit(end_creation(state, name, outcome))
  register_created(name, client, body = padded(request_body(fields, key), handle_kinds$post))
  answer <- withCallingHandlers(
    post_once(client, "/v1/envs/", fields, key = key, call = call),
    gym_error_http = function(cnd) outcome <<- "refused",
    gym_error_connection = function(cnd) if (isFALSE(cnd$reached)) outcome <<- "unsent"
  )
  check_instance_id(answer$instance_id)
  suspendInterrupts({
    note_protocol(state, answer)
    register_created(created_name(client, answer$instance_id), client, answer$instance_id)
    outcome <- "created"
  })
  answer$instance_id
}

end_creation <- function(state, name, outcome) {
  if (outcome == "lost") {
    state$creation_keys <- new_idempotency_keys()
    state$to_close <- c(state$to_close, name)
  } else {
    unregister_created(name)
  }
}

instance_route <- function(instance_id) {
  paste0("/v1/envs/", curl::curl_escape(instance_id), "/")
}

# Registering ----------------------------------------------------------------------

created_name <- function(client, instance_id) paste(client$remote_base, instance_id)

register_created <- function(name, client, instance_id = NULL, body = NULL) {
  assign(
    name, list(client = client, pid = Sys.getpid(), instance_id = instance_id, body = body),
    envir = the_session$created
  )
}

unregister_created <- function(name) {
  if (exists(name, envir = the_session$created, inherits = FALSE)) {
    rm(list = name, envir = the_session$created)
  }
}

# For a server that has ended, and its instances with it.
unregister_created_on <- function(base) {
  names <- ls(the_session$created, all.names = TRUE, sorted = FALSE)
  rm(list = names[startsWith(names, paste0(base, " "))], envir = the_session$created)
}

# Closing --------------------------------------------------------------------------

#' Close an instance that nobody can use any more
#'
#' A server that hangs delays this by two seconds at most.
#' @noRd
close_without_waiting <- function(client, instance_id) {
  if (!is.null(instance_id)) {
    queue_for_closing(client, instance_id)
    close_queued(client)
  }
}

# A finalizer may do no more than this, because it may run in the middle of a request.
queue_for_closing <- function(client, instance_id) {
  name <- created_name(client, instance_id)
  if (exists(name, envir = the_session$created, inherits = FALSE)) {
    state <- client_state(client)
    state$to_close <- c(state$to_close, name)
  }
}

#' Close the instances that were queued for closing
#'
#' Those that cannot be closed in time are tried again only at the end of the session, so that a
#' server that hangs delays one call and not every call.
#' @noRd
close_queued <- function(client) {
  state <- client_state(client)
  if (length(state$to_close)) {
    names <- state$to_close
    state$to_close <- character()
    close_within(names, closing_time)
  }
}

# At the end of the session. The instances on servers of the session's own end with these.
close_session_instances <- function(seconds) {
  names <- ls(the_session$created, all.names = TRUE, sorted = FALSE)
  close_within(Filter(function(name) !on_own_server(the_session$created[[name]]), names), seconds)
}

on_own_server <- function(entry) !is.null(the_session$servers[[entry$client$remote_base]])

#' Close instances, all at once, in a limited time
#'
#' This is the one place beside [send()] that speaks HTTP. It does not use a client's connection,
#' which may be in the middle of a request; it does not repeat requests that fail; and it does not
#' send them one after the other, because a server may hang on each.
#' @param names The names of the instances in `the_session$created`.
#' @noRd
close_within <- function(names, seconds) {
  names <- Filter(function(name) is_own_entry(the_session$created[[name]]), names)
  if (!length(names)) {
    return(invisible())
  }
  pool <- curl::new_pool()
  on.exit(lapply(curl::multi_list(pool), curl::multi_cancel))
  deadline <- proc.time()[["elapsed"]] + seconds
  post <- function(entry, route, body, done) {
    handle <- closing_handle(entry$client, route, body, deadline - proc.time()[["elapsed"]])
    curl::multi_add(handle, done = done, fail = function(reason) NULL, pool = pool)
  }
  close_entry <- function(name) {
    entry <- the_session$created[[name]]
    route <- paste0(instance_route(entry$instance_id), "close/")
    post(entry, route, charToRaw("{}"), function(response) unregister_created(name))
  }
  ask_for_id <- function(name) {
    entry <- the_session$created[[name]]
    post(entry, "/v1/envs/", entry$body, function(response) {
      instance_id <- tryCatch(
        string_or_null(parsed_body(response)$instance_id), error = function(cnd) NULL
      )
      unregister_created(name)
      if (!is.null(instance_id)) {
        created <- created_name(entry$client, instance_id)
        register_created(created, entry$client, instance_id)
        close_entry(created)
      }
    })
  }
  for (name in names) {
    if (is.null(the_session$created[[name]]$body)) close_entry(name) else ask_for_id(name)
  }
  curl::multi_run(timeout = seconds, pool = pool)
  invisible()
}

# A forked child has its parent's entries in its memory, too, but must not close these instances.
is_own_entry <- function(entry) !is.null(entry) && entry$pid == Sys.getpid()

closing_handle <- function(client, route, body, seconds) {
  handle <- new_handle(client, json_type, json_type)
  curl::handle_setopt(
    handle,
    url = paste0(client$remote_base, route), post = TRUE,
    postfieldsize = length(body), postfields = body,
    timeout_ms = max(1, seconds * 1000), connecttimeout_ms = max(1, seconds * 1000)
  )
  handle
}
