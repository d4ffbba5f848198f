# Errors of a call: the server refused it, nobody answered, or the answer is not from a Gym server.

abort_http <- function(response, method, call) {
  status <- response$status_code
  problem <- lapply(
    list(message = "message", code = "code", hint = "hint", extra = "extra"),
    function(name) {
      text <- response$answer[[name]]
      if (rlang::is_string(text)) shown_text(text)
    }
  )
  if (identical(problem$code, "unknown_instance")) check_not_restarted(response$url, call)
  request <- paste(method, response$url)
  status_text <- tryCatch(httr::http_status(status)$reason, error = function(cnd) "")
  hint <- extra_hint(problem$extra, response$url) %||% token_hint(problem$code) %||%
    in_r(problem$hint)
  gym_abort(
    c(
      if (is.null(problem$message)) foreign_answer_message(response) else sentence(problem$message),
      i = sentence(hint)
    ),
    class = c(
      if (identical(problem$code, "action_not_in_space")) "gym_error_space",
      paste0("gym_error_http_", status),
      "gym_error_http"
    ),
    status = status,
    code = problem$code,
    hint = hint,
    parent = rlang::error_cnd(
      message = paste0(request, " [", trimws(paste(status, status_text)), "]")
    ),
    call = call
  )
}

token_hint <- function(code) {
  if (identical(code, "unauthorized")) {
    paste0("`create_GymClient(token = )` takes the server's token, and so does the environment ",
           "variable ", token_variable)
  }
}

# The server's hints name its routes, because its clients are written in many languages.
in_r <- function(hint) {
  if (!is.null(hint)) sub("GET /v1/instances/", "`env_list()`", hint, fixed = TRUE)
}

# How to install a missing extra. The code that starts a server adds a function for this to the
# server's entry. Other servers have their own operators.
extra_hint <- function(extra, url) {
  server <- the_session$servers[[base_of(url)]]
  if (!is.null(extra) && !is.null(server$extra_hint)) server$extra_hint(extra)
}

# The server's messages start in lower case and end without a full stop, so that they fit anywhere.
# This makes a sentence of a message. Only a first word of plain letters gets a capital, because ids
# and names of arguments keep their case. A quoted command gets no full stop, because people would
# copy it.
sentence <- function(text) {
  if (is.null(text)) {
    return(NULL)
  }
  if (grepl("^[a-z]+([ ,.:;']|$)", text)) {
    text <- paste0(chartr("a-z", "A-Z", substr(text, 1L, 1L)), substring(text, 2L))
  }
  if (grepl("[.?!\"]$", text)) text else paste0(text, ".")
}

# `reached`: whether the server may have received the request.
abort_connection <- function(url, reason, call, reached = TRUE) {
  base <- base_of(url)
  hangs <- reached && grepl("timed out|timeout", reason, ignore.case = TRUE)
  lost <- environments_on(base)
  gym_abort(
    if (!hangs && own_server_ended(base)) {
      c(
        paste0("The server at ", base, " has ended."),
        end_bullets(base),
        i = "`gym_make()` starts another; `gym_server_log()` has the log of this one."
      )
    } else {
      c(
        paste0("No answer from the server at ", base, "."),
        x = reason,
        i = if (hangs) hanging_hint(base) else connection_hint(base, reason),
        i = if (!hangs && !is.null(lost)) paste0("If it has ended, these are lost: ", lost, ".")
      )
    },
    class = "gym_error_connection",
    url = base,
    reached = reached,
    call = call
  )
}

# After a connection broke: whether its server has ended, if this session started it. The process
# ends a moment after the connection.
own_server_ended <- function(base) {
  process <- the_session$servers[[base]]$process
  if (is.null(process) || Sys.getpid() != the_session$pid) {
    return(FALSE)
  }
  await_end(process, 1)
  !process$is_alive()
}

hanging_hint <- function(base) {
  paste(
    "It accepted the call, but needs longer than the client's `timeout`, or it hangs.",
    if (!is.null(the_session$servers[[base]])) {
      "`gym_server_stop()` stops a server of this session; `gym_make()` then starts another."
    } else {
      "`create_GymClient(timeout = )` waits longer; restart a server that hangs."
    }
  )
}

connection_hint <- function(base, reason) {
  if (grepl("certificate|SSL peer", reason)) {
    return(paste(
      "This machine does not trust its certificate.",
      "`httr::set_config(httr::config(cainfo = \"FILE\"))` adds your own."
    ))
  }
  if (!is.null(the_session$servers[[base]])) {
    return("This session started it; see `gym_server_log()`.")
  }
  place <- local_place(base)
  if (is.null(place)) {
    "Is the address right, and is a server running there?"
  } else {
    paste0("Is a server running there? `", start_call(place), "` starts one.")
  }
}

abort_no_answer <- function(response, call) {
  gym_abort(
    c(
      "The answer does not come from a Gym server.",
      x = paste0(response$url, " gave status ", response$status_code, " and ",
                 response$type %||% "content of no type", "."),
      i = foreign_server_hint(response$url, server_name(response))
    ),
    class = "gym_error_connection",
    url = response$url,
    call = call
  )
}

# The name by which a program identifies itself in a response of curl or httr.
server_name <- function(response) {
  headers <- response$headers
  if (is.raw(headers)) {
    headers <- curl::parse_headers_list(headers)
  }
  shown_line(headers[["server"]])
}

# A proxy answers with these statuses if the server behind it does not answer.
proxy_statuses <- 502:504

# The message for a refusal from another program.
foreign_answer_message <- function(response) {
  if (response$status_code %in% proxy_statuses) {
    c("There is a proxy at this address, and the server behind it does not answer.",
      i = "It may be restarting. If this lasts, tell its operator.")
  } else if (response$status_code == 413L) {
    c("The request exceeds the limit of the proxy at this address.",
      i = "Its operator sets that limit, in nginx `client_max_body_size`.")
  } else {
    c("The answer does not come from a Gym server.",
      i = foreign_server_hint(response$url, server_name(response)))
  }
}

#' Guess which other program answered, and say what helps
#' @param url Where it answered.
#' @param name The name by which it identifies itself, a string or `NULL`.
#' @return One or two sentences.
#' @noRd
foreign_server_hint <- function(url, name) {
  if (grepl("^AirTunes", name %||% "")) {
    return(paste(
      "That is AirPlay, which uses port 5000 on macOS. `server <- gym_server_start()` uses a",
      "free port; or switch \"AirPlay Receiver\" off in the System Settings (General, AirDrop &",
      "Handoff)."
    ))
  }
  called <- if (!is.null(name)) paste0("It calls itself \"", name, "\". ")
  free <- if (!is.null(local_place(base_of(url)))) {
    " If another program has that port, `server <- gym_server_start()` uses a free one."
  }
  paste0(called, "Is the address that of a Gym server?", free)
}
