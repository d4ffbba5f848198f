# Who listens at an address: nobody, a Gym server, or another program.

#' Find the host and port of a server on this machine
#' @return A list of `host`, as the server takes it, and `port`; `NULL` for any other address
#'   and one that no server of ours can have.
#' @noRd
local_place <- function(base) {
  pattern <- "^http://(127([.][0-9]{1,3}){3}|localhost|\\[::1\\]):([0-9]{1,5})$"
  parts <- regmatches(base, regexec(pattern, base))[[1L]]
  if (!length(parts)) {
    return(NULL)
  }
  port <- as.integer(parts[[4L]])
  if (port < 1L || port > 65535L) {
    return(NULL)
  }
  host <- gsub("[][]", "", parts[[2L]])
  list(host = if (host == "localhost") "127.0.0.1" else host, port = port)
}

# The call that starts a server at a place.
start_call <- function(place) {
  host <- if (place$host != "127.0.0.1") paste0(", host = \"", place$host, "\"")
  paste0("gym_server_start(port = ", place$port, host, ")")
}

#' Ask an address who listens there
#'
#' By a route that every Gym server has, the classic one too.
#' @param timeout How long the answer may take, in seconds. A server that takes connections
#'   but does not answer in time listens nevertheless.
#' @param token For a server that is known to be ours; a stranger is shown none.
#' @return A list of `listens`, `is_gym` and `asks_token` (it wants another token, or one; all
#'   three are logical), `status` (of the answer), `name` (what the program calls
#'   itself, a string or `NULL`), `instances` (how many a Gym server has) and `problem` (why
#'   there is no answer, a string or `NULL`).
#' @noRd
probe_server <- function(base, timeout, token = NULL) {
  client <- new_client(base, timeout, httr::config(forbid_reuse = TRUE), token)
  problem <- NULL
  response <- tryCatch(
    send(client, "/v1/envs/"),
    gym_error_connection = function(cnd) {
      problem <<- conditionMessage(cnd)
      NULL
    }
  )
  times <- curl::handle_data(client$state$line$channels$get$handle)$times
  envs <- response$answer$all_envs
  asks_token <- identical(response$answer$code, "unauthorized")
  list(
    listens = !is.null(response) || times[["connect"]] > 0,
    is_gym = !is.null(envs) || asks_token,
    status = response$status_code,
    asks_token = asks_token,
    name = if (!is.null(response)) server_name(response),
    instances = length(envs),
    problem = problem
  )
}

# The program's own name for itself, from an answer of curl's or httr's.
server_name <- function(response) {
  headers <- response$headers
  if (is.raw(headers)) {
    headers <- curl::parse_headers_list(headers)
  }
  shown_line(headers[["server"]])
}

# By which a proxy says that the server behind it gave it no answer.
proxy_statuses <- 502:504

# What to say of a refusal that no Gym server wrote.
stranger_words <- function(response) {
  if (response$status_code %in% proxy_statuses) {
    c("There is a proxy at this address, and the server behind it does not answer.",
      i = "It may be starting anew. If that lasts, its operator should know.")
  } else if (response$status_code == 413L) {
    c("The request is larger than the proxy at this address takes.",
      i = "Its operator sets that limit, in nginx `client_max_body_size`.")
  } else {
    c("The answer is not what a Gym server sends.",
      i = stranger_hint(response$url, server_name(response)))
  }
}

#' Say what a program that is no Gym server may be, and what helps
#' @param url Where it answered.
#' @param name What it calls itself, a string or `NULL`.
#' @return One or two sentences.
#' @noRd
stranger_hint <- function(url, name) {
  if (grepl("^AirTunes", name %||% "")) {
    return(paste(
      "That is AirPlay, to which macOS gives port 5000. `server <- gym_server_start()` takes a",
      "free port; or switch \"AirPlay Receiver\" off in the System Settings (General, AirDrop &",
      "Handoff)."
    ))
  }
  called <- if (!is.null(name)) paste0("It calls itself \"", name, "\". ")
  free <- if (!is.null(local_place(base_of(url)))) {
    " If another program has that port: `server <- gym_server_start()` takes a free one."
  }
  paste0(called, "Is the address that of a Gym server?", free)
}

#' Say who has the port that a server was to take
#' @return A sentence, `NULL` when nobody seems to.
#' @noRd
port_holder <- function(base) {
  holder <- probe_server(base, timeout = 2)
  if (!holder$listens) {
    return(NULL)
  }
  use <- paste0("`create_GymClient(\"", base, "\")` talks to it")
  if (is_running(base)) {
    paste0("This session's own server has it: ", use, ".")
  } else if (holder$is_gym) {
    paste0("A Gym server has it: ", use, ".")
  } else if (is.null(holder$name)) {
    "Another program has it. `gym_server_start()` without a port takes a free one."
  } else {
    stranger_hint(base, holder$name)
  }
}
