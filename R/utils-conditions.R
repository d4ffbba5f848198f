# Every error of the package is made here, so that each has a class.

gym_abort <- function(message, class = NULL, ..., call = rlang::caller_env(), parent = NULL) {
  rlang::abort(
    # A server's words are among them.
    shown_text(message),
    class = c(class, "gym_error"),
    ...,
    call = without_tokens(rlang::error_call(call)),
    trace = hidden_trace(rlang::current_env()),
    parent = parent
  )
}

abort_http <- function(response, method, call) {
  status <- response$status_code
  problem <- lapply(
    list(message = "message", code = "code", hint = "hint", extra = "extra"),
    function(name) shown_text(string_or_null(response$answer[[name]]))
  )
  request <- paste(method, response$url)
  status_text <- tryCatch(httr::http_status(status)$reason, error = function(cnd) "")
  hint <- extra_hint(problem$extra, request) %||% token_hint(problem$code) %||%
    in_r(problem$hint)
  gym_abort(
    c(
      if (is.null(problem$message)) stranger_words(response) else sentence(problem$message),
      i = sentence(hint),
      " " = paste0(request, " [", trimws(paste(status, status_text)), "]")
    ),
    class = c(
      if (identical(problem$code, "action_not_in_space")) "gym_error_space",
      paste0("gym_error_http_", status),
      "gym_error_http"
    ),
    status = status,
    code = problem$code,
    hint = hint,
    call = call
  )
}

token_hint <- function(code) {
  if (identical(code, "unauthorized")) {
    paste0("`create_GymClient(token = )` takes the server's token, and so does the environment ",
           "variable ", token_variable)
  }
}

# The server speaks to users of every language.
in_r <- function(hint) {
  if (!is.null(hint)) sub("GET /v1/instances/", "`env_list()`", hint, fixed = TRUE)
}

# What is missing on a server that runs from what gym_server_install() made is installed by
# that; what is missing on another is its operator's affair.
extra_hint <- function(extra, request) {
  base <- sub("^\\S+ ([a-z]+://[^/]*).*", "\\1", request)
  server <- the_session$servers[[base]]
  if (is.null(extra) || is.null(server) || !is_installed_python(server$python)) {
    return(NULL)
  }
  anew <- "`gym_server_stop()` ends this server, and the next `gym_make()` starts one that has it"
  if (extra %in% installed_server()$extras) {
    return(paste0("it has been installed meanwhile: ", anew))
  }
  paste0("`gym_server_install(extras = \"", extra, "\")` installs it; ", anew)
}

# The server's words begin in lower case and have no full stop, to stand anywhere. One after a
# command that ends in a quote would be copied with it.
sentence <- function(text) {
  if (is.null(text)) {
    return(NULL)
  }
  if (!grepl("^[a-z_]+\\(", text)) {
    text <- paste0(toupper(substr(text, 1L, 1L)), substring(text, 2L))
  }
  if (grepl("[.?!\"]$", text)) text else paste0(text, ".")
}

# `reached`: whether the server can have had the call.
abort_connection <- function(url, reason, call, reached = TRUE) {
  base <- base_of(url)
  hangs <- reached && grepl("timed out|timeout", reason, ignore.case = TRUE)
  gym_abort(
    c(
      paste0("No answer from the server at ", base, "."),
      x = reason,
      i = if (hangs) hanging_mend(base) else connection_mend(base, reason)
    ),
    class = "gym_error_connection",
    url = base,
    reached = reached,
    call = call
  )
}

hanging_mend <- function(base) {
  paste(
    "It took the call, but works longer on it than the client's `timeout`, or it hangs.",
    if (!is.null(the_session$servers[[base]])) {
      "`gym_server_stop()` ends a server of this session's; `gym_make()` then starts another."
    } else {
      "`create_GymClient(timeout = )` waits longer; a server that hangs must be started anew."
    }
  )
}

connection_mend <- function(base, reason) {
  if (grepl("certificate|SSL peer", reason)) {
    return(paste(
      "Its certificate is not one that this machine trusts.",
      "`httr::set_config(httr::config(cainfo = \"FILE\"))` names one that is your own."
    ))
  }
  if (!is.null(the_session$servers[[base]])) {
    return(paste(
      "This session started it; `gym_server_log()` has its last words.",
      "`gym_make()` starts another when it has ended."
    ))
  }
  place <- local_place(base)
  if (is.null(place)) {
    "Is that its address, and is it running there?"
  } else {
    paste0("Is a server running there? `", start_call(place), "` starts one.")
  }
}

base_of <- function(url) sub("(//[^/]*).*", "\\1", url)

abort_no_answer <- function(response, call) {
  gym_abort(
    c(
      "The answer is not what a Gym server sends.",
      x = paste0(response$url, " gave status ", response$status_code, " and ",
                 response$type %||% "content of no type", "."),
      i = stranger_hint(response$url, server_name(response))
    ),
    class = "gym_error_connection",
    url = response$url,
    call = call
  )
}

# `path` is the place of the value in the whole, "" for the whole.
abort_space <- function(space, value, problem, call, path = "") {
  place <- if (nzchar(path)) paste0("At `", if (!startsWith(path, "$")) "$", path, "`: the")
  gym_abort(
    c(
      paste0(problem, "."),
      x = paste0(place %||% "The", " value ", describe_value(value), " does not fit the space ",
                 format(space), ".")
    ),
    class = "gym_error_space",
    space = space,
    value = value,
    path = path,
    call = call
  )
}

describe_value <- function(value) {
  text <- paste(deparse(value, width.cutoff = 60L, nlines = 3L), collapse = " ")
  if (nchar(text) > 80L) paste0(substr(text, 1L, 77L), "...") else text
}
