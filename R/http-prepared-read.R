# Reading the answers of calls that are made in every step, in which only the numbers differ.

#' Make the function that reads the responses of a prepared call that come as JSON
#'
#' @param read_answer As that of [prepare_call()]; it may return `NULL`, or fail.
#' @noRd
new_json_reader <- function(read_answer) {
  function(response, key, number) {
    content <- response$content
    if (response$status_code != 200L || !identical(response$type, json_type) ||
          length(content) > small_answer) {
      return(NULL)
    }
    answer <- from_json(rawToChar(content))
    if (is.list(answer) && is_echo(answer$request, key, number)) read_answer(answer)
  }
}

# Servers with the classic protocol repeat no idempotency key.
is_echo <- function(request, key, number) {
  is.null(request) || identical(request$key, key) && isTRUE(request$number == number)
}

#' Make the function that reads the responses of a prepared call that come as tensors
#'
#' @param layouts As [read_tensors()] takes them.
#' @param finish A function of the tensors of an answer that says nothing more than these, whose
#'   like `read_answer` has read before. The tensor "observation" has its names.
#' @param labels The names of the numbers of an observation, `NULL` for none.
#' @noRd
new_tensors_reader <- function(layouts, read_answer, finish, labels) {
  read_json <- new_json_reader(read_answer)
  form <- NULL
  function(response, key, number) {
    tensors <- if (!is.null(form)) tensors_of_form(form, response, key, number)
    if (!is.null(tensors)) {
      return(finish(tensors))
    }
    type <- response$type
    if (!is_tensors_type(type)) {
      return(read_json(response, key, number))
    }
    sent <- list(key = key, number = number)
    by_column <- type == column_tensors_type
    answer <- tensors_answer(response$content, layouts, sent, by_column)
    if (response$status_code != 200L || !is_echo(answer$request, key, number)) {
      return(NULL)
    }
    result <- read_answer(answer)
    if (!"texts" %in% names(answer)) {
      form <<- new_form(response, layouts, key, by_column, labels)
    }
    result
  }
}

is_tensors_type <- function(type) {
  identical(type, tensors_type) || identical(type, column_tensors_type)
}

#' Keep what the answers to one kind of call have in common
#'
#' @param response One that says nothing more than its tensors.
#' @return A list of the response's `type`, the `key` and the first bytes, up to the number of the
#'   idempotency key; how long the rest of the header is; and the tensors, in their order. `NULL`
#'   where one is empty.
#' @noRd
new_form <- function(response, layouts, key, by_column, labels) {
  data <- 8L + header_size(response$content)
  layout <- known_layout(response$content[9L:data], layouts)
  mark <- '"number\\":'
  before <- bare_metadata(list(key = key, number = 0))
  before <- regexpr(mark, before, fixed = TRUE) + nchar(mark) - 1L
  same <- 8L + length(layout$start) + before
  begins <- vapply(layout$entries, function(entry) as.double(entry$begin), 0)
  entries <- layout$entries[order(begins)]
  sizes <- vapply(entries, function(entry) as.double(entry$size), 0)
  if (any(sizes == 0)) {
    return(NULL)
  }
  list(
    type = response$type, key = key, same = seq_len(same), start = response$content[seq_len(same)],
    rest = seq.int(same + 1L, data), data = data, total = data + sum(sizes),
    entries = Map(form_entry, entries, names(entries), by_column, list(labels))
  )
}

# A tensor, and how its numbers are put into their places: by attributes alone where they can be.
form_entry <- function(entry, name, by_column, labels) {
  labels <- if (name == "observation") labels
  shape <- entry$shape
  if (length(shape) == 2L && !is.null(labels)) {
    labels <- list(NULL, labels)
  }
  if (length(shape) <= 1L) {
    entry$attributes <- if (!is.null(labels)) list(names = labels)
  } else if (by_column) {
    entry$attributes <- c(list(dim = rev(shape)), if (!is.null(labels)) list(dimnames = labels))
  } else {
    entry$place <- row_placer(shape, labels)
  }
  entry
}

row_placer <- function(shape, labels) {
  if (length(shape) > 2L) {
    return(function(values) place_by_row(values, shape))
  }
  function(values) {
    if (is.raw(values) || is.object(values)) {
      place_by_row(values, shape)
    } else {
      matrix(values, shape[[1L]], shape[[2L]], byrow = TRUE, dimnames = labels)
    }
  }
}

# Returns the tensors of a response, `NULL` where it is not like the one that the form was made of.
tensors_of_form <- function(form, response, key, number) {
  content <- response$content
  alike <- response$status_code == 200L && identical(response$type, form$type) &&
    identical(key, form$key) && length(content) == form$total &&
    identical(content[form$same], form$start)
  if (!alike) {
    return(NULL)
  }
  ending <- c(charToRaw(sprintf('%.0f}"}}', number)), json_blanks)[seq_along(form$rest)]
  if (identical(content[form$rest], ending)) read_form_entries(form, content)
}

read_form_entries <- function(form, content) {
  large <- length(content) > index_up_to
  if (large) {
    file <- rawConnection(content)
    on.exit(close(file))
    readBin(file, "raw", form$data)
  }
  before <- form$data
  entries <- form$entries
  for (i in seq_along(entries)) {
    entry <- entries[[i]]
    end <- before + entry$size
    bytes <- if (large) readBin(file, "raw", entry$size) else content[(before + 1L):end]
    values <- entry$read(bytes, entry$n)
    if (!is.null(entry$place)) {
      values <- entry$place(values)
    } else {
      if (is.raw(values)) values <- as.integer(values)
      if (!is.null(entry$attributes)) attributes(values) <- entry$attributes
    }
    entries[[i]] <- values
    before <- end
  }
  entries
}
