# JSON for requests. Doubles keep 17 significant digits (jsonlite writes 15). Numbers that JSON does
# not have become "NaN", "Infinity" and "-Infinity".

json_number <- function(x) {
  if (is.integer(x)) {
    text <- sprintf("%d", x)
  } else if (is.logical(x)) {
    text <- ifelse(x, "true", "false")
  } else {
    text <- with_decimal_point(sprintf("%.17g", x))
    # Most parsers read "-0" as the integer 0.
    text[text == "-0"] <- "-0.0"
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
  x <- enc2utf8(x)
  special <- grepl("[\"\\\\\\x01-\\x1f]", x, perl = TRUE)
  if (any(special)) x[special] <- json_escape(x[special])
  paste0("\"", x, "\"", recycle0 = TRUE)
}

json_escape <- function(x) {
  x <- gsub("\\", "\\\\", x, fixed = TRUE)
  x <- gsub("\"", "\\\"", x, fixed = TRUE)
  if (any(grepl("[\\x01-\\x1f]", x, perl = TRUE))) {
    for (code in 1:31) {
      x <- gsub(rawToChar(as.raw(code)), sprintf("\\u%04x", code), x, fixed = TRUE)
    }
  }
  x
}

# A JSON object from JSON texts whose names need no escaping, such as a request's fields.
json_object <- function(fields) {
  paste0("{", paste0("\"", names(fields), "\":", fields, recycle0 = TRUE, collapse = ","), "}")
}

json_texts <- function(values) vapply(values, to_json, "")

json_array <- function(elements) paste0("[", paste0(elements, collapse = ","), "]")

# Nests the elements of an array, given row by row (last index fastest).
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
#' A named list becomes an object, an unnamed list an array. A vector of length one becomes a single
#' value, unless it is wrapped in `I()`. An array becomes nested arrays, row by row.
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
    fields <- paste0(json_string(names(x)), ":", elements, recycle0 = TRUE)
    return(paste0("{", paste0(fields, collapse = ","), "}"))
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
  plain_numbers(x, "value", NULL)
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

# Parses JSON. Integers beyond 2^53 become text, so that none is rounded.
from_json <- function(text) {
  if (nchar(text, "bytes") > 2L * deepest_json) {
    check_json_depth(text)
  }
  Encoding(text) <- "UTF-8"
  if (grepl("\\u0000", text, fixed = TRUE, useBytes = TRUE)) {
    refuse_nul(text)
  }
  with_decimal_point(jsonlite::parse_json(text, bigint_as_char = TRUE))
}

# Our server nests spaces up to 100 levels deep, with three brackets per level. Deeper JSON could
# overflow the stack: of the code that reads the values first, and of the parser at about ten
# thousand levels.
deepest_json <- 320L

# Only a text that is longer than this number of opening and closing brackets can be too deep.
check_json_depth <- function(text) {
  # Remove strings: their brackets do not count.
  text <- gsub("\"(?:[^\"\\\\]++|\\\\.)*+\"", "", text, perl = TRUE, useBytes = TRUE)
  bytes <- as.integer(charToRaw(text))
  depth <- cumsum(bytes %in% utf8ToInt("[{")) - cumsum(bytes %in% utf8ToInt("]}"))
  if (any(depth > deepest_json)) {
    abort_answer(paste("Its JSON is nested more than", deepest_json, "levels deep"))
  }
}

# Refuses the escaped character NUL, but not an escaped backslash before "u0000".
refuse_nul <- function(text) {
  # Search the bytes, because the text may not be UTF-8. The parser refuses such a text later.
  if (grepl("(?<!\\\\)(\\\\\\\\)*\\\\u0000", text, perl = TRUE, useBytes = TRUE)) {
    gym_abort(
      "A text from the server has the character NUL, which R strings cannot contain.",
      class = "gym_error_space",
      call = NULL
    )
  }
}

# Returns JSON numbers, nested or not, as a numeric vector. Some may be text: "NaN", "Infinity" or
# "-Infinity".
numbers_from_json <- function(elements) {
  numbers <- unlist(elements, use.names = FALSE)
  if (is.character(numbers)) {
    numbers <- rapply(as.list(elements), number_from_json, how = "unlist")
  }
  if (is.null(numbers)) numeric() else numbers
}

number_from_json <- function(x) {
  if (is.character(x) && !is_json_number(x)) {
    abort_answer(paste(describe_value(x), "is not a number"))
  }
  as.numeric(x)
}

# Integers beyond 2^53 and numbers that are not finite are sent as text.
is_json_number <- function(x) {
  length(x) == 1L &&
    (is.numeric(x) || is.character(x) && grepl("^(-?[0-9]+|NaN|-?Infinity)$", x))
}

# Returns whole numbers from JSON, which has integers beyond 2^53 as text.
whole_from_json <- function(json) {
  numbers <- unlist(json, use.names = FALSE)
  if (is.character(numbers)) {
    if (!all(grepl("^-?[0-9]+$", numbers))) {
      abort_answer(paste(describe_value(numbers), "is not a whole number"))
    }
    numbers <- as.numeric(rapply(as.list(json), whole_text, how = "unlist"))
    check_exact(numbers)
    return(narrow_whole(numbers))
  }
  if (is.double(numbers)) {
    check_exact(numbers)
  }
  if (is.null(numbers)) integer() else numbers
}

# Infos --------------------------------------------------------------------------

# Converts an info from JSON to R values. An info has no space: arrays of plain values of one kind
# become vectors, arrays of such arrays with one shape become arrays, the rest stays a list.
info_from_json <- function(x, depth = 0L) {
  if (depth > deepest_info) {
    abort_answer(paste("Its info is nested more than", deepest_info, "levels deep"))
  }
  if (!is.list(x)) {
    if (is_number_word(x)) number_from_json(x) else x
  } else if (!length(x)) {
    x
  } else if (!is.null(names(x))) {
    lapply(x, info_from_json, depth + 1L)
  } else if (any(vapply(x, is.list, NA))) {
    # Evaluate this first: as a promise, it would make the stack deeper at each level.
    rows <- lapply(x, info_from_json, depth + 1L)
    stack_rows(rows, x)
  } else {
    info_vector(x)
  }
}

# Our server nests infos up to 128 levels deep.
deepest_info <- 160L

is_number_word <- function(x) is.character(x) && x %in% c("NaN", "Infinity", "-Infinity")

info_vector <- function(x) {
  all_are <- function(is_kind) all(vapply(x, is_kind, NA))
  # "NaN" and the infinities are numbers, unless there is other text beside them.
  if (all_are(function(one) is.numeric(one) || is_number_word(one))) {
    numbers_from_json(x)
  } else if (all_are(is.logical) || all_are(is.character)) {
    unlist(x)
  } else {
    lapply(x, info_from_json)
  }
}

# Makes an array from rows with one shape. `rows` were read from the JSON arrays `json`.
stack_rows <- function(rows, json) {
  first <- rows[[1L]]
  shape <- array_shape(first)
  kind <- function(row) if (is.numeric(row)) "number" else typeof(row)
  alike <- function(row, elements) {
    is.list(elements) && is.null(names(elements)) && is.atomic(row) &&
      identical(array_shape(row), shape) && kind(row) == kind(first)
  }
  if (all(mapply(alike, rows, json))) {
    shape_values(unlist(lapply(rows, row_major)), c(length(rows), shape))
  } else {
    rows
  }
}
