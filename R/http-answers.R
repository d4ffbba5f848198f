# Reading an answer: its JSON or tensors, or the error that it reports.

#' Read an answer or raise the error that it reports
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

# Returns an answer as a list, NULL for an empty one; what cannot be parsed is an error.
parsed_body <- function(response, layouts = NULL, key = NULL) {
  if (response$status_code == 204L) {
    NULL
  } else if (identical(response$type, column_tensors_type)) {
    tensors_answer(response$content, layouts, key, by_column = TRUE)
  } else if (identical(response$type, tensors_type)) {
    tensors_answer(response$content, layouts, key)
  } else if (identical(response$type, "image/png")) {
    list(png = response$content)
  } else {
    check_json_size(response$content)
    answer <- from_json(rawToChar(response$content))
    if (is.list(answer)) answer
  }
}

# The server repeats a request's idempotency key in its answer: with another key the answer
# belongs to another request.
check_echo <- function(response, answer, call) {
  sent <- response$key
  if (is.null(sent)) {
    return()
  }
  echo <- if (response$status_code == 204L) echo_in_header(response) else answer$request
  if (!is.null(echo) && !is_same_key(echo, sent)) {
    abort_connection(response$url, "The answer that came belongs to another call.", call)
  }
}

is_same_key <- function(echo, sent) {
  is.list(echo) && identical(echo$key, sent$key) && is_number(echo$number) &&
    echo$number == sent$number
}

echo_in_header <- function(response) {
  echo <- curl::parse_headers_list(response$headers)[["gym-request"]]
  if (!is.null(echo)) {
    parts <- strsplit(echo, " ", fixed = TRUE)[[1L]]
    list(key = parts[[1L]], number = suppressWarnings(as.numeric(parts[2L])))
  }
}

# An answer with tensors has the fields of the JSON answer that it replaces, and beside them the
# tensors and the texts by their names.
tensors_answer <- function(bytes, layouts, key = NULL, by_column = FALSE) {
  file <- read_tensors(bytes, layouts, if (!is.null(key)) bare_metadata(key), by_column)
  if (is.null(file$metadata)) {
    return(list(tensors = file$tensors, info = empty_object, request = key))
  }
  field <- function(name) {
    text <- file$metadata[[name]]
    if (!is.null(text)) from_json(text)
  }
  list(
    tensors = file$tensors,
    texts = field("texts"),
    info = if (identical(file$metadata$info, "{}")) empty_object else field("info"),
    final_sub_envs = field("final_sub_envs"),
    request = field("request"),
    error = field("error")
  )
}

# The metadata of an answer that repeats the idempotency key and has an empty info.
bare_metadata <- function(key) {
  sprintf(
    '{"info":"{}","request":"{\\"key\\":\\"%s\\",\\"number\\":%.0f}"}}',
    key$key, key$number
  )
}

empty_object <- structure(list(), names = character())
