# The instances that this session has created on servers. R closes an instance that nobody uses any
# more: after garbage collection of its object, if the call that makes it fails after the server's
# answer, and at the end of the session.

# The most seconds that closing in the background may take, for all instances together.
closing_time <- 2

# Creates an instance on the server and remembers it. Returns the answer.
create_on_server <- function(client, fields, call) {
  key <- next_key(client_state(client)$keys)
  # An interrupt after the answer must not come before the instance is remembered.
  suspendInterrupts({
    answer <- allowInterrupts(post_answer(client, "/v1/envs/", fields, key, call = call))
    if (is.null(answer$instance_id)) refuse_field(NULL, "instance_id", "a string")
    remember_instance(client, answer$instance_id, shown_line(answer$env_id), answer$server)
  })
  answer
}

instance_route <- function(instance_id) {
  paste0("/v1/envs/", curl::curl_escape(instance_id), "/")
}

# The place of an instance in `the_session$instances`.
instance_place <- function(client, instance_id) paste(client$remote_base, instance_id)

# `server` is the text by which a server identifies itself. It changes when a server restarts.
remember_instance <- function(client, instance_id, env_id = NULL, server = NULL) {
  the_session$instances[[instance_place(client, instance_id)]] <- list(
    client = client, pid = Sys.getpid(), instance_id = instance_id, env_id = env_id, server = server
  )
}

forget_instance <- function(place) {
  drop_streams(function(stream) stream$place == place)
  the_session$keys[[paste(place, Sys.getpid())]] <- NULL
  if (exists(place, envir = the_session$instances, inherits = FALSE)) {
    rm(list = place, envir = the_session$instances)
  }
}

places_on <- function(base) {
  places <- ls(the_session$instances, all.names = TRUE)
  places[startsWith(places, paste0(base, " "))]
}

# Forgets all instances of a server that was stopped.
forget_instances_of <- function(base) {
  drop_streams(function(stream) stream$client$remote_base == base)
  rm(list = places_on(base), envir = the_session$instances)
}

# Text for a message: the environments of this session at an address, or on one server there. `NULL`
# if there are none.
environments_on <- function(base, server = NULL) {
  entries <- mget(places_on(base), the_session$instances)
  if (!is.null(server)) {
    entries <- Filter(function(entry) identical(entry$server, server), entries)
  }
  names <- vapply(entries, function(entry) paste0(entry$env_id, " (", entry$instance_id, ")"), "")
  if (length(names)) few_names(unname(names))
}

# Bullets of a message: why a server of this session has ended, and which environments were lost.
end_bullets <- function(base) {
  server <- the_session$servers[[base]]
  lost <- environments_on(base)
  c(
    x = if (!is.null(server)) server$why_ended(),
    i = if (!is.null(lost)) paste0("Lost with it: ", lost, ".")
  )
}

# A server that was started again at the same address, for example by the front of
# `gym_server_start(users = )`, does not know older instances. Raises an error that says so.
check_not_restarted <- function(url, call) {
  entry <- the_session$instances[[sub("^(.*)/v1/envs/([^/]*)/.*$", "\\1 \\2", url)]]
  if (is.null(entry$server)) {
    return(invisible())
  }
  # If the server does not answer now, the first error stays.
  server <- tryCatch(
    get_answer(entry$client, "/v1/health/")$server, gym_error = function(cnd) entry$server
  )
  if (!identical(server, entry$server)) {
    base <- entry$client$remote_base
    gym_abort(
      c(
        paste0("The server at ", base, " has ended and was started again."),
        i = paste0("Lost with it: ", environments_on(base, entry$server), "."),
        i = "Make them again with `gym_make()`."
      ),
      class = "gym_error_connection", url = base, reached = TRUE, call = call
    )
  }
}

# Closing --------------------------------------------------------------------------

#' Close an instance that no object in R uses
#' @noRd
close_unused <- function(client, instance_id) {
  if (!is.null(instance_id)) {
    queue_closing(client, instance_id)
    close_queued(client)
  }
}

# Puts an instance on the list of instances to close. A finalizer must not do more, because it may
# run during a request.
queue_closing <- function(client, instance_id) {
  place <- instance_place(client, instance_id)
  if (exists(place, envir = the_session$instances, inherits = FALSE)) {
    state <- client_state(client)
    state$to_close <- c(state$to_close, place)
  }
}

#' Close the instances on the list
#'
#' If an instance cannot be closed in time, R tries again only at the end of the session. So a
#' server that hangs delays only one call.
#' @noRd
close_queued <- function(client) {
  state <- client_state(client)
  if (length(state$to_close)) {
    places <- state$to_close
    state$to_close <- character()
    close_together(places, closing_time)
  }
}

# For the end of the session. Instances on the session's own servers end with these servers.
close_session_instances <- function(seconds) {
  places <- ls(the_session$instances, all.names = TRUE, sorted = FALSE)
  is_elsewhere <- function(place) {
    is.null(the_session$servers[[the_session$instances[[place]]$client$remote_base]])
  }
  close_together(Filter(is_elsewhere, places), seconds)
}

#' Close several instances in a limited time
#'
#' This does not use a client's line, which may be busy. It repeats nothing, and closes all
#' instances at the same time, because each call may hang. A forked child does not close its
#' parent's instances.
#' @param places Their places in `the_session$instances`.
#' @noRd
close_together <- function(places, seconds) {
  is_own <- function(place) identical(the_session$instances[[place]]$pid, Sys.getpid())
  places <- Filter(is_own, places)
  if (!length(places)) {
    return(invisible())
  }
  pool <- curl::new_pool()
  on.exit(lapply(curl::multi_list(pool), curl::multi_cancel))
  deadline <- now() + seconds
  for (place in places) local({
    entry <- the_session$instances[[place]]
    left <- max(1, (deadline - now()) * 1000)
    line <- new_line(entry$client)
    curl::handle_setopt(line$handle, timeout_ms = left, connecttimeout_ms = left)
    set_line(line, "POST", json_body(NULL), json_type, json_type)
    url <- paste0(entry$client$remote_base, instance_route(entry$instance_id), "close/")
    start_request(line, url, pool, function(response) {
      if (!inherits(response, "error")) forget_instance(place)
    })
  })
  curl::multi_run(timeout = seconds, pool = pool)
  invisible()
}
