# JSON as the wire wants it: doubles keep 17 significant digits (jsonlite writes
# 15), numbers that JSON cannot write travel as "NaN", "Infinity", "-Infinity".

json_number <- function(x) {
  if (inherits(x, "integer64")) {
    return(as.character(x))
  }
  if (is.integer(x)) {
    text <- sprintf("%d", x)
  } else {
    text <- sprintf("%.17g", x)
  }
  odd <- !is.finite(x)
  if (any(odd)) {
    text[odd] <- ifelse(
      is.nan(x[odd]), '"NaN"',
      ifelse(is.na(x[odd]), "null", ifelse(x[odd] > 0, '"Infinity"', '"-Infinity"'))
    )
  }
  text
}

json_string <- function(x) {
  vapply(
    enc2utf8(x),
    function(string) as.character(jsonlite::toJSON(string, auto_unbox = TRUE)),
    character(1),
    USE.NAMES = FALSE
  )
}

# An object of elements that are JSON already, its names too.
json_object <- function(names, elements) {
  if (!length(elements)) {
    return("{}")
  }
  paste0("{", paste0(names, ":", elements, collapse = ","), "}")
}

json_array <- function(elements) paste0("[", paste0(elements, collapse = ","), "]")

# Nest the elements of an array, given row by row (last index fastest).
json_nested <- function(elements, shape) {
  if (length(shape) <= 1L) {
    return(json_array(elements))
  }
  inner <- prod(shape[-1L])
  rows <- lapply(
    seq_len(shape[1L]),
    function(i) json_nested(elements[(i - 1L) * inner + seq_len(inner)], shape[-1L])
  )
  json_array(rows)
}

#' Write an R value as JSON
#'
#' A named list is an object, an unnamed list an array, a vector of length one
#' a scalar unless wrapped in `I()`, an array is nested row by row.
#' @noRd
to_json <- function(x) {
  if (is.null(x)) {
    return("null")
  }
  if (is.list(x)) {
    elements <- vapply(unname(x), to_json, character(1))
    if (is.null(names(x))) {
      return(json_array(elements))
    }
    return(json_object(json_string(names(x)), elements))
  }
  if (is.array(x)) {
    return(json_nested(json_atoms(row_major(x)), dim(x)))
  }
  if (length(x) == 1L && !inherits(x, "AsIs")) json_atoms(x) else json_array(json_atoms(x))
}

json_atoms <- function(x) {
  if (is.factor(x)) {
    x <- as.character(x)
  }
  switch(typeof(x),
    logical = ifelse(is.na(x), "null", ifelse(x, "true", "false")),
    integer = ,
    double = json_number(x),
    character = ifelse(is.na(x), "null", json_string(x)),
    gym_abort(
      paste0("A value of type ", typeof(x), " cannot be sent to the server."),
      class = "gym_error_argument",
      call = NULL
    )
  )
}

# The elements of an array with its last index running fastest, as on the wire.
row_major <- function(x) {
  if (length(dim(x)) > 1L) as.vector(aperm(x)) else as.vector(x)
}

# Parse an answer. Integers beyond 2^53 come as text, so that none is rounded.
from_json <- function(text) {
  Encoding(text) <- "UTF-8"
  jsonlite::parse_json(text, bigint_as_char = TRUE)
}

# JSON numbers, nested or not, some perhaps the words for NaN and the infinities,
# as a numeric vector.
numbers_from_json <- function(elements) {
  numbers <- unlist(elements, use.names = FALSE)
  if (is.character(numbers)) {
    numbers <- rapply(elements, number_from_json, how = "unlist")
  }
  if (is.null(numbers)) numeric() else numbers
}

number_from_json <- function(x) {
  if (is.character(x)) {
    switch(x, "NaN" = NaN, "Infinity" = Inf, "-Infinity" = -Inf, as.numeric(x))
  } else {
    as.numeric(x)
  }
}

# Infos hold whatever an environment puts there: arrays of plain values of one
# kind become vectors, the rest stays a list.
info_from_json <- function(x) {
  if (is.list(x)) {
    x <- lapply(x, info_from_json)
    if (is_plain_array(x)) unlist(x) else x
  } else if (is.character(x) && x %in% c("NaN", "Infinity", "-Infinity")) {
    number_from_json(x)
  } else {
    x
  }
}

is_plain_array <- function(x) {
  if (length(x) == 0L || !is.null(names(x)) || !all(lengths(x) == 1L)) {
    return(FALSE)
  }
  kinds <- vapply(x, function(element) if (is.numeric(element)) "number" else typeof(element), "")
  kinds[[1L]] != "list" && all(kinds == kinds[[1L]])
}
