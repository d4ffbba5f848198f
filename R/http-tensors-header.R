# The header of a safetensors file, which says what lies where. What does not add up is refused.

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

known_layout <- function(header, layouts) {
  if (is.null(layouts)) {
    return(read_layout(header))
  }
  text <- rawToChar(header)
  at <- regexpr(metadata_key, text, fixed = TRUE, useBytes = TRUE)
  start <- if (at > 0L) rawToChar(header[seq_len(at - 1L)]) else text
  known <- match(start, names(layouts$seen))
  if (!is.na(known)) {
    return(layouts$seen[[known]])
  }
  layout <- read_layout(header)
  if (nchar(start, "bytes") <= max_seen_bytes) {
    seen <- c(stats::setNames(list(layout), start), layouts$seen)
    layouts$seen <- utils::head(seen, max_layouts)
  }
  layout
}

# Enough for the kinds of answer of a few environments. With autoreset mode "SameStep" an answer has
# the last observations of as many sub-environments as have ended.
max_layouts <- 256L

# A longer table of tensors is not remembered, so that no server can fill the memory with them.
max_seen_bytes <- 2^16

# A table may have so many bytes, as in a request to our server: that is room for some ten thousand
# tensors, which take some seconds to read.
max_table_bytes <- 2^20

# Marks where the metadata begin: elsewhere, in names and texts, quotes are escaped.
metadata_key <- ",\"__metadata__\":"

#' Parse a header
#' @return A list of `entries`, one for each tensor; `metadata`, where they stand before them;
#'   `end`, where the last tensor ends; `start`, with which all headers of this layout begin: the
#'   whole header, or all up to the metadata where they come last; `metadata_last`, whether they do.
#' @noRd
read_layout <- function(header) {
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
  tensors <- lapply(entries[names(entries) != "__metadata__"], read_entry)
  list(
    entries = tensors,
    metadata = entries[["__metadata__"]],
    end = end_of_tensors(tensors),
    start = header,
    metadata_last = metadata_last
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

# Where the last tensor ends. Tensors that lie over one another would take more memory than the
# file, so they must fill the data, one after the other.
end_of_tensors <- function(tensors) {
  begins <- vapply(tensors, function(entry) as.double(entry$begin), 0)
  ends <- begins + vapply(tensors, function(entry) as.double(entry$size), 0)
  in_order <- order(begins, ends)
  wrong <- match(FALSE, begins[in_order] == c(0, ends[in_order])[seq_along(tensors)])
  if (!is.na(wrong)) {
    name <- names(tensors)[[in_order[[wrong]]]]
    abort_tensors(paste("there is a gap or an overlap before the tensor", to_json(name)))
  }
  max(0, ends)
}

last_metadata <- function(header, layout) {
  if (layout$metadata_last) {
    metadata <- rawToChar(header[-seq_along(layout$start)])
    tryCatch(
      from_json(paste0("{\"last\":", metadata))$last,
      error = function(cnd) abort_tensors("the metadata are no JSON")
    )
  }
}

read_entry <- function(entry) {
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
  # R takes a part of a vector by integers in less time than by doubles.
  whole <- if (offsets[[2L]] <= .Machine$integer.max) as.integer else identity
  list(
    read = type$read, n = n, shape = as.integer(shape),
    begin = whole(offsets[[1L]]), size = whole(size)
  )
}

# Returns the elements of a JSON array of whole numbers from 0 on, NULL for anything else.
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
