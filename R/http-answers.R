# Reads an answer: its JSON or tensors, or the error that it reports.

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

# A response with its parsed `answer`: `NULL` if there is none or it cannot be read; an error of
# this package then says why.
with_answer <- function(response) {
  answer <- tryCatch(
    parsed_body(response),
    error = function(cnd) if (inherits(cnd, "gym_error")) rlang::cnd_signal(cnd)
  )
  response["answer"] <- list(answer)
  response
}

# Returns an answer as a list, NULL for an empty one. An unreadable answer is an error.
parsed_body <- function(response) {
  if (response$status_code == 204L) {
    NULL
  } else if (isTRUE(response$type %in% c(tensors_type, column_tensors_type))) {
    tensors_answer(response$content, response$type == column_tensors_type)
  } else if (identical(response$type, "image/png")) {
    list(png = response$content)
  } else {
    check_json_size(response$content)
    json_answer(response$content)
  }
}

# Returns the answer, or NULL if it is no object. `tensors` is the part that only read_tensors() may
# make.
json_answer <- function(content) {
  answer <- from_json(rawToChar(content))
  if (is.list(answer)) {
    answer$tensors <- NULL
    answer
  }
}

# An answer with tensors has the fields of the JSON answer that it replaces, and also the tensors
# and texts by their names.
tensors_answer <- function(bytes, by_column) {
  file <- read_tensors(bytes, by_column)
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
