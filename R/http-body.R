# The bodies of requests. Of a prepared request only little changes from one time to the next: the
# idempotency key's number, and what is given as content.

#' Make the function that writes a body of JSON
#'
#' @param fields JSON texts of the fields that it always has, named.
#' @return A function of the members of a JSON object, each with a comma after it, and of the
#'   idempotency key, which returns a raw vector. Without a key there are the fields alone.
#' @noRd
new_json_body <- function(fields) {
  of_key <- ending <- NULL
  function(content, key) {
    if (is.null(key)) {
      return(charToRaw(json_object(fields)))
    }
    if (!identical(of_key, key$key)) {
      ending <<- paste0(json_members(fields), '"request":{"key":"', key$key, '","number":')
      of_key <<- key$key
    }
    bytes <- charToRaw(paste0("{", content, ending, sprintf("%.0f}}", key$number)))
    missing <- length(json_blanks) - length(bytes)
    if (missing > 0L) c(bytes, json_blanks[seq_len(missing)]) else bytes
  }
}

# curl needs the length of a body beforehand, and setting it costs as much as half a request: small
# bodies are padded to one length. Blanks at the end of a JSON text mean nothing.
json_blanks <- rep(as.raw(0x20), 256L)

# Each member with a comma after it.
json_members <- function(fields) {
  if (length(fields)) paste0("\"", names(fields), "\":", fields, ",", collapse = "") else ""
}

key_json <- function(key) sprintf('{"key":"%s","number":%.0f}', key$key, key$number)

#' Make the function that writes a body of tensors
#'
#' @param n How many integers are sent where the content is integers.
#' @return A function as that of [new_json_body()]. Its content is a list as [to_tensors()] returns
#'   it, or integers, the tensor "action".
#' @noRd
new_tensors_body <- function(fields, n = NULL) {
  of_integers <- if (!is.null(n)) {
    write_table(list(action = list(dtype = "I32", shape = n, bytes = raw(4 * n))))
  }
  # All that stands before the tensors, split at the number of the idempotency key. It is kept as
  # long as that has as many digits.
  parts <- NULL
  header <- function(table, key) {
    digits <- charToRaw(sprintf("%.0f", key$number))
    known <- length(digits) == length(parts$digits) && identical(parts$table, table) &&
      identical(parts$key, key$key)
    if (!known) parts <<- split_header(fields, table, key, digits)
    c(parts$before, digits, parts$after)
  }
  function(content, key) {
    if (is.integer(content)) {
      return(with_integers(header(of_integers, key), content))
    }
    texts <- vapply(content, is.character, NA)
    if (any(texts)) {
      # They stand among the metadata, so that the header is another one each time.
      fields <- c(fields, texts = to_json(content[texts]), request = key_json(key))
      return(write_tensors(content[!texts], fields))
    }
    do.call(c, c(list(header(tensors_table(content), key)), lapply(unname(content), `[[`, "bytes")))
  }
}

# From this number on integers are put behind a header as integers: R joins them faster than bytes.
join_as_integers <- 1024L

with_integers <- function(header, integers) {
  if (length(integers) < join_as_integers) {
    c(header, writeBin(integers, raw(), endian = "little"))
  } else {
    words <- readBin(header, "integer", length(header) / 4L, endian = "little")
    writeBin(c(words, integers), raw(), endian = "little")
  }
}

split_header <- function(fields, table, key, digits) {
  header <- tensors_header(c(fields, request = key_json(key)), table)
  # The quotes of the request are escaped in the header.
  mark <- paste0('number\\":', rawToChar(digits))
  end <- regexpr(mark, rawToChar(header[-(1:8)]), fixed = TRUE) + 8L + nchar(mark) - 1L
  list(
    table = table, key = key$key, digits = digits,
    before = header[seq_len(end - length(digits))], after = header[-seq_len(end)]
  )
}
