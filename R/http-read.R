# Reading the answers to prepared requests, in which only the numbers differ from one to the next.

#' Make the function that reads answers that come as JSON
#' @param read_answer A function of a parsed answer; it may return `NULL`, or fail.
#' @return A function, `read` of [prepare_request()].
#' @noRd
new_json_reader <- function(read_answer) {
  function(response, key) {
    content <- response$content
    if (response$status_code == 200L && identical(response$type, json_type) &&
          length(content) <= small_answer) {
      answer <- from_json(rawToChar(content))
      if (is.list(answer)) read_answer(answer)
    }
  }
}

#' Make the function that reads answers that come as tensors
#'
#' The layout of the last answer that was read is remembered.
#' @param read_answer As for [new_json_reader()].
#' @param finish A function of the tensors of an answer that says nothing more than these, of a
#'   layout that `read_answer` has read before. The tensor "observation" has its names.
#' @param labels The names of the numbers of an observation, `NULL` for none.
#' @noRd
new_tensors_reader <- function(read_answer, finish, labels) {
  read_json <- new_json_reader(read_answer)
  layout <- NULL
  read_by_header <- function(content, by_column, key) {
    known <- has_layout(content, layout)
    fresh <- if (known) layout else read_layout(content, by_column)
    result <- read_answer(tensors_answer(content, fresh))
    if (!known && length(fresh$start) <= small_answer) {
      layout <<- prepare_layout(fresh, labels, key)
    }
    result
  }
  function(response, key) {
    content <- response$content
    if (response$status_code != 200L || !is_tensors_type(response$type)) {
      read_json(response, key)
    } else if (is_bare(content, layout, key)) {
      finish(read_entries(content, layout))
    } else {
      read_by_header(content, response$type == column_tensors_type, key)
    }
  }
}

# Adds to a layout the names of an observation's numbers, and how an answer begins that has an empty
# info, the idempotency key and nothing more, up to the number of that key.
prepare_layout <- function(layout, labels, key) {
  # Not with `$`, which would find the only part of a Tuple or Dict, "observation/...".
  if ("observation" %in% names(layout$entries)) {
    layout$entries[["observation"]] <- place_entry(layout$entries[["observation"]], labels)
  }
  bare <- sprintf('{"info":"{}","request":"{\\"key\\":\\"%s\\",\\"number\\":', key$key)
  layout$bare <- c(layout$start, charToRaw(bare))
  layout$same <- seq_along(layout$bare)
  layout$rest <- seq.int(length(layout$bare) + 1L, max(layout$data, length(layout$bare) + 1L))
  layout
}

is_bare <- function(content, layout, key) {
  if (is.null(layout) || length(content) != layout$total) {
    return(FALSE)
  }
  ending <- c(charToRaw(sprintf('%.0f}"}}', key$number)), json_blanks)
  identical(content[layout$same], layout$bare) &&
    identical(content[layout$rest], ending[seq_along(layout$rest)])
}

is_tensors_type <- function(type) {
  identical(type, tensors_type) || identical(type, column_tensors_type)
}
