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
  } else if (is_tensors_type(response$type)) {
    by_column <- response$type == column_tensors_type
    tensors_answer(response$content, read_layout(response$content, by_column))
  } else if (identical(response$type, message_type)) {
    list(message = response$content)
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
    named = layout$named,
    final_sub_envs = field("final_sub_envs"),
    error = field("error")
  )
}

empty_object <- structure(list(), names = character())

# Answers to prepared requests, which differ only in their numbers -------------------------------

#' Make the function that reads answers in JSON
#' @param read_answer A function of a parsed answer, which may return `NULL` or fail.
#' @return A function, `read` of [prepare_request()].
#' @noRd
new_json_reader <- function(read_answer) {
  function(response, key) {
    content <- response$content
    if (response$status_code == 200L && identical(response$type, json_type) &&
          length(content) <= small_answer) {
      answer <- json_answer(content)
      if (!is.null(answer)) read_answer(answer)
    }
  }
}

#' Make the function that reads answers with tensors
#'
#' It remembers the layout of the last answer. From an answer with the same layout and no other
#' content it reads only the tensors.
#' @param read_answer As for [new_json_reader()].
#' @param labels The names of the numbers of an observation, `NULL` for none. If there are any, the
#'   answer's observations get them, and it has `named`.
#' @noRd
new_tensors_reader <- function(read_answer, labels) {
  read_json <- new_json_reader(read_answer)
  layout <- NULL
  function(response, key) {
    content <- response$content
    known <- !is.null(layout) && response$status_code == 200L &&
      identical(response$type, layout$type) && length(content) == layout$total &&
      identical(content[layout$first], layout$start)
    if (!known) {
      if (response$status_code != 200L || !is_tensors_type(response$type)) {
        return(read_json(response, key))
      }
      fresh <- read_layout(content, response$type == column_tensors_type)
      fresh <- prepare_layout(fresh, labels, key)
      fresh$type <- response$type
      result <- read_answer(tensors_answer(content, fresh))
      if (length(fresh$start) <= small_answer) layout <<- fresh
      return(result)
    }
    ending <- c(charToRaw(sprintf('%.0f}"}}', key$number)), json_blanks)
    bare <- identical(content[layout$middle], layout$bare) &&
      identical(content[layout$rest], ending[seq_along(layout$rest)])
    read_answer(if (bare) {
      list(tensors = read_entries(content, layout), info = empty_object, named = layout$named)
    } else {
      tensors_answer(content, layout)
    })
  }
}

# Adds the names of an observation's numbers to a layout, and the bytes after the table, up to the
# key's number, of an answer with only an empty info and the idempotency key.
prepare_layout <- function(layout, labels, key) {
  layout$named <- !is.null(labels)
  for (name in intersect(c("observation", "final_obs"), names(layout$entries))) {
    layout$entries[[name]] <- place_entry(layout$entries[[name]], labels)
  }
  bare <- sprintf('{"info":"{}","request":"{\\"key\\":\\"%s\\",\\"number\\":', key$key)
  layout$bare <- charToRaw(bare)
  layout$first <- seq_along(layout$start)
  layout$middle <- length(layout$start) + seq_along(layout$bare)
  end <- length(layout$start) + length(layout$bare)
  layout$rest <- seq.int(end + 1L, max(layout$data, end + 1L))
  layout
}

is_tensors_type <- function(type) {
  identical(type, tensors_type) || identical(type, column_tensors_type)
}
