# Reading an answer: its JSON or tensors, or the error that it reports.

#' Read an answer or raise the error that it reports
#' @param response From [with_answer()].
#' @return The parsed answer, `NULL` for an empty one.
#' @noRd
read_answer <- function(response, method, call = rlang::caller_env()) {
  answer <- response$answer
  if (response$status_code >= 400L) {
    abort_http(response, method, call)
  }
  if (response$status_code != 204L && is.null(answer)) {
    abort_no_answer(response, call)
  }
  answer
}

# A response with its `answer` parsed: `NULL` for none, or one that cannot be read. An error of ours
# says why that is.
with_answer <- function(response) {
  answer <- tryCatch(
    parsed_body(response),
    error = function(cnd) if (inherits(cnd, "gym_error")) rlang::cnd_signal(cnd)
  )
  response["answer"] <- list(answer)
  response
}

# Returns an answer as a list, NULL for an empty one; what cannot be parsed is an error.
parsed_body <- function(response) {
  if (response$status_code == 204L) {
    NULL
  } else if (is_tensors_type(response$type)) {
    by_column <- response$type == column_tensors_type
    tensors_answer(response$content, read_layout(response$content, by_column))
  } else if (identical(response$type, "image/png")) {
    list(png = response$content)
  } else {
    check_json_size(response$content)
    answer <- from_json(rawToChar(response$content))
    if (is.list(answer)) answer
  }
}

# An answer with tensors has the fields of the JSON answer that it replaces, and beside them the
# tensors and the texts by their names.
tensors_answer <- function(bytes, layout) {
  file <- read_tensors(bytes, layout)
  field <- function(name) {
    text <- file$metadata[[name]]
    if (!is.null(text)) from_json(text)
  }
  list(
    tensors = file$tensors,
    texts = field("texts"),
    info = if (identical(file$metadata$info, "{}")) empty_object else field("info"),
    final_sub_envs = field("final_sub_envs"),
    error = field("error")
  )
}

empty_object <- structure(list(), names = character())
