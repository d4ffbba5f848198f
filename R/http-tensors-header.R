# The header of a safetensors file, which locates the tensors. Inconsistent headers are refused.

header_size <- function(bytes) {
  if (length(bytes) < 8L) {
    abort_tensors("the file has fewer than 8 bytes")
  }
  size <- readBin(bytes, "integer", 2L, size = 4L, endian = "little")
  if (anyNA(size) || size[[2L]] != 0L || size[[1L]] < 2L || size[[1L]] > length(bytes) - 8L) {
    abort_tensors("the header is longer than the file")
  }
  size[[1L]]
}

# The largest table in bytes, as in a request to our server: enough for some ten thousand tensors,
# which take some seconds to read.
max_table_bytes <- 2^20

# The start of the metadata: elsewhere, in names and texts, quotes are escaped.
metadata_key <- ",\"__metadata__\":"

#' Read the header of a file
#'
#' @param by_column Whether the tensors are transposed and their shapes reversed, so that the bytes
#'   are in R's order.
#' @return The common part of all files with one layout, a list: `start`, their first bytes, up to
#'   the metadata if these are last, as in our server's files; `entries`, the tensors in the order
#'   of their bytes; `data`, the number of bytes before these; `total`, the number of all bytes;
#'   `metadata_last`; and `metadata`, if they are not last.
#' @noRd
read_layout <- function(bytes, by_column = FALSE) {
  data <- 8L + header_size(bytes)
  header <- bytes[9L:data]
  check_json_size(header)
  if (any(header == as.raw(0L))) {
    abort_tensors("the header is no JSON")
  }
  table <- rawToChar(header)
  at <- regexpr(metadata_key, table, fixed = TRUE, useBytes = TRUE)
  metadata_last <- at > 0L
  if (metadata_last) {
    table <- paste0(rawToChar(header[seq_len(at - 1L)]), "}")
    header <- header[seq_len(at - 1L + nchar(metadata_key))]
  }
  if (nchar(table, "bytes") > max_table_bytes) {
    abort_tensors(paste("the table of tensors is larger than", count_of(max_table_bytes, "byte")))
  }
  entries <- tryCatch(
    from_json(table),
    error = function(cnd) abort_tensors("the header is no JSON")
  )
  if (!is.list(entries) || is.null(names(entries)) && length(entries)) {
    abort_tensors("the header is no JSON object")
  }
  check_entry_names(names(entries))
  tensors <- lapply(entries[names(entries) != "__metadata__"], read_entry, by_column)
  begins <- vapply(tensors, function(entry) entry$begin, 0)
  sizes <- vapply(tensors, function(entry) as.double(entry$size), 0)
  tensors <- tensors[check_filled(begins, begins + sizes)]
  if (sum(sizes) != length(bytes) - data) {
    abort_tensors(paste("the tensors have", count_of(sum(sizes), "byte"), "and the file",
                        length(bytes) - data))
  }
  list(
    start = c(bytes[1:8], header), entries = tensors, data = data, total = length(bytes),
    metadata_last = metadata_last, metadata = entries[["__metadata__"]]
  )
}

check_entry_names <- function(names) {
  if (!all(nzchar(names))) {
    abort_tensors("a tensor has no name")
  }
  twice <- anyDuplicated(names)
  if (twice) {
    abort_tensors(paste("the header has the name", to_json(names[[twice]]), "twice"))
  }
}

# Returns the order of the tensors. Overlapping tensors would take more memory than the file, so
# they must fill the data, one after the other.
check_filled <- function(begins, ends) {
  in_order <- order(begins, ends)
  wrong <- match(FALSE, begins[in_order] == c(0, ends[in_order])[seq_along(begins)])
  if (!is.na(wrong)) {
    name <- names(begins)[[in_order[[wrong]]]]
    abort_tensors(paste("there is a gap or an overlap before the tensor", to_json(name)))
  }
  in_order
}

read_entry <- function(entry, by_column) {
  if (!is.list(entry) || !all(c("dtype", "shape", "data_offsets") %in% names(entry))) {
    abort_tensors("the header lacks the place of a tensor")
  }
  type <- if (rlang::is_string(entry$dtype)) tensor_types[[entry$dtype, exact = TRUE]]
  if (is.null(type)) {
    abort_tensors(paste("the dtype", to_json(entry$dtype), "is not known"))
  }
  shape <- naturals_from_json(entry$shape)
  offsets <- naturals_from_json(entry$data_offsets)
  if (is.null(shape) || any(shape > .Machine$integer.max) || length(offsets) != 2L) {
    abort_tensors("the header lacks the place of a tensor")
  }
  n <- prod(shape)
  size <- offsets[[2L]] - offsets[[1L]]
  if (size != n * type$size) {
    abort_tensors("an offset does not fit its tensor")
  }
  # R indexes a vector faster by integers than by doubles.
  whole <- if (offsets[[2L]] <= .Machine$integer.max) as.integer else identity
  place_entry(list(
    read = type$read, n = n, shape = as.integer(shape), by_column = by_column,
    begin = offsets[[1L]], size = whole(size)
  ))
}

#' Decide how to give a tensor's numbers their shape
#' @param labels The names of the numbers in a row, `NULL` for none.
#' @return The entry with `attributes`, if these are enough, or with `place`, a function of the
#'   numbers.
#' @noRd
place_entry <- function(entry, labels = NULL) {
  shape <- entry$shape
  if (length(shape) == 2L && !is.null(labels)) {
    labels <- list(NULL, labels)
  }
  if (length(shape) <= 1L) {
    entry$attributes <- if (!is.null(labels)) list(names = labels)
  } else if (entry$by_column) {
    entry$attributes <- c(list(dim = rev(shape)), if (!is.null(labels)) list(dimnames = labels))
  } else {
    entry$place <- function(values) place_by_row(values, shape, labels)
  }
  entry
}

# Returns the elements of a JSON array of whole numbers of at least 0, NULL for anything else.
naturals_from_json <- function(elements) {
  is_number <- function(x) is.numeric(x) && length(x) == 1L
  if (!is.list(elements) || !is.null(names(elements)) || !all(vapply(elements, is_number, NA))) {
    return(NULL)
  }
  numbers <- as.double(unlist(elements))
  if (all(is.finite(numbers) & numbers >= 0 & numbers == floor(numbers))) numbers
}

abort_tensors <- function(problem) {
  gym_abort(
    paste0("The tensors that came cannot be read: ", problem, "."),
    class = "gym_error_connection",
    problem = problem,
    call = NULL
  )
}
