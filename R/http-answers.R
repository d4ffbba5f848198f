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

# Its size ----------------------------------------------------------------------------------

# Limits the size of an answer, so that no server can fill this session's memory.

# Enough for 5,000 frames of Atari games, or some millions of numbers as JSON. R needs up to eight
# times the bytes of a tensor, and up to seventy times those of JSON.
default_answer_bytes <- 2^29
json_share <- 1 / 16

answer_bytes_option <- function() getOption("gym.max_answer_bytes", default_answer_bytes)

max_answer_bytes <- function(call = NULL) {
  bytes <- answer_bytes_option()
  check_number(bytes, min = 1, arg = "options(gym.max_answer_bytes)", call = call)
  bytes
}

# Answers up to this size are always accepted, because reading the option takes time in each call.
small_answer <- 2^16

# Checks the size of a JSON text before it is parsed.
check_json_size <- function(content) {
  if (length(content) > small_answer && length(content) > max_answer_bytes() * json_share) {
    abort_too_large(json_share, "R needs much memory for JSON: its limit is a sixteenth.")
  }
}

abort_too_large <- function(share = 1, reason = NULL, base = NULL, call = NULL) {
  most <- max_answer_bytes(call) * share
  gym_abort(
    c(
      paste0("The answer of the server", if (!is.null(base)) paste0(" at ", base),
             " is larger than ", count_of(floor(most), "byte"), "."),
      x = reason,
      i = "`options(gym.max_answer_bytes = )` sets the limit."
    ),
    class = "gym_error_connection", url = base, call = call
  )
}
