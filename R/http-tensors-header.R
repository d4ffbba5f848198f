# The header of a safetensors file, which locates the tensors.

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

# The most tensors, which take some seconds to read.
most_tensors <- 2^14

#' Read the header of a file
#'
#' @return A list: `entries`, the tensors in the order of their bytes; `data`, the number of bytes
#'   before these; `metadata`.
#' @noRd
read_layout <- function(bytes, by_column = FALSE) {
  data <- 8L + header_size(bytes)
  header <- bytes[9L:data]
  check_json_size(header)
  if (any(header == as.raw(0L))) {
    abort_tensors("the header is no JSON")
  }
  # Our server writes the metadata last. What comes before is mostly the same as in the last file.
  at <- regexpr(",\"__metadata__\":", rawToChar(header), fixed = TRUE, useBytes = TRUE)
  table <- if (at > 0L) c(header[seq_len(at - 1L)], charToRaw("}")) else header
  table <- c(as.raw(by_column), table)
  if (!identical(last_table$bytes, table)) {
    entries <- header_json(table[-1L])
    tensors <- entries[names(entries) != "__metadata__"]
    if (length(tensors) > most_tensors) {
      abort_tensors(paste("there are more than", count_of(most_tensors, "tensor")))
    }
    tensors <- lapply(tensors, read_entry, by_column)
    last_table$entries <- tensors[order(vapply(tensors, function(tensor) tensor$begin, 0))]
    last_table$size <- sum(vapply(tensors, function(tensor) as.double(tensor$size), 0))
    last_table$metadata <- entries[["__metadata__"]]
    last_table$bytes <- table
  }
  metadata <- if (at > 0L) {
    header_json(c(charToRaw("{"), header[-seq_len(at)]))[["__metadata__"]]
  } else {
    last_table$metadata
  }
  # With as many bytes as the file, tensors take no more memory than it.
  if (last_table$size != length(bytes) - data) {
    abort_tensors(paste("the tensors have", count_of(last_table$size, "byte"), "and the file",
                        length(bytes) - data))
  }
  list(entries = last_table$entries, data = data, metadata = metadata)
}

last_table <- new.env(parent = emptyenv())

header_json <- function(bytes) {
  json <- tryCatch(
    from_json(rawToChar(bytes)), error = function(cnd) abort_tensors("the header is no JSON")
  )
  if (!is_object(json)) {
    abort_tensors("the header is no JSON object")
  }
  json
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
  shape <- as.integer(shape)
  entry <- list(
    read = type$read, n = n, dim = if (length(shape) > 1L) rev(shape), begin = offsets[[1L]],
    size = whole(size)
  )
  if (!by_column && length(shape) > 1L) {
    entry$place <- function(values) place_by_row(values, shape)
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
