# safetensors files: the length of a header (8 bytes), the header (JSON: name to
# dtype, shape and place), then the bytes of the tensors, little-endian and row
# by row. https://huggingface.co/docs/safetensors

# Reading -----------------------------------------------------------------------

#' Read a safetensors file
#'
#' @param bytes A raw vector.
#' @param by_column Whether the tensors are transposed and their shapes reversed, so that the bytes
#'   are in R's order.
#' @return A list of `tensors`, a named list of vectors and arrays, and `metadata`, a named list of
#'   strings.
#' @noRd
read_tensors <- function(bytes, by_column = FALSE) {
  layout <- read_values(read_layout(bytes, by_column), "Its header")
  list(tensors = read_entries(bytes, layout), metadata = layout$metadata)
}

# The most tensors of a file. Reading so many takes some seconds.
most_tensors <- 2^14

#' Read the header of a file
#'
#' @return A list: `entries`, the tensors in the order of their bytes; `data`, the number of bytes
#'   before these; `metadata`.
#' @noRd
read_layout <- function(bytes, by_column) {
  size <- readBin(bytes, "integer", 2L, size = 4L, endian = "little")
  data <- 8L + size[[1L]]
  if (size[[2L]] != 0L || length(bytes) < data) abort_answer("The file is shorter than its header")
  header <- bytes[9L:data]
  check_json_size(header)
  json <- from_json(rawToChar(header))
  entries <- json[names(json) != "__metadata__"]
  if (length(entries) > most_tensors) {
    abort_answer(paste("There are more than", count_of(most_tensors, "tensor")))
  }
  entries <- lapply(entries, read_entry, by_column)
  entries <- entries[order(vapply(entries, function(entry) entry$begin, 0))]
  # The tensors must have as many bytes as the file: so they cannot take more memory than it.
  size <- sum(vapply(entries, function(entry) as.double(entry$size), 0))
  if (size != length(bytes) - data) {
    abort_answer(paste("The tensors have", count_of(size, "byte"), "and the file",
                       length(bytes) - data))
  }
  list(entries = entries, data = data, metadata = json[["__metadata__"]])
}

read_entry <- function(entry, by_column) {
  type <- tensor_types[[entry$dtype]]
  shape <- as.integer(unlist(entry$shape))
  offsets <- as.double(unlist(entry$data_offsets))
  n <- prod(shape)
  size <- offsets[[2L]] - offsets[[1L]]
  if (size != n * type$size) abort_answer("An offset does not fit its tensor")
  # R indexes a vector faster by integers than by doubles.
  whole <- if (offsets[[2L]] <= .Machine$integer.max) as.integer else identity
  entry <- list(
    read = type$read, n = n, dim = if (length(shape) > 1L) rev(shape), begin = offsets[[1L]],
    size = whole(size)
  )
  if (!by_column && length(shape) > 1L) {
    entry$place <- function(values) place_by_row(values, shape)
  }
  entry
}

# Tensors of a file up to this size are read by an index. For a larger file, a raw connection is
# faster, although it copies the file once.
index_up_to <- 8192L

read_entries <- function(bytes, layout) {
  large <- length(bytes) > index_up_to
  if (large) {
    file <- rawConnection(bytes)
    on.exit(close(file))
    readBin(file, "raw", layout$data)
  }
  before <- layout$data
  entries <- layout$entries
  for (i in seq_along(entries)) {
    entry <- entries[[i]]
    part <- if (large) {
      readBin(file, "raw", entry$size)
    } else if (entry$size) {
      bytes[(before + 1L):(before + entry$size)]
    } else {
      raw()
    }
    values <- entry$read(part, entry$n)
    if (!is.null(entry$place)) {
      values <- entry$place(values)
    } else {
      if (is.raw(values)) values <- as.integer(values)
      if (!is.null(entry$dim)) dim(values) <- entry$dim
    }
    entries[[i]] <- values
    if (!large) before <- before + entry$size
  }
  entries
}

# Reorders bytes before they become integers: they are a fourth of the size.
place_by_row <- function(values, shape) {
  values <- shape_values(values, shape)
  if (is.raw(values)) array(as.integer(values), shape) else values
}

# The types -----------------------------------------------------------------------

# Each function takes bytes and returns numbers in the same order.

read_numbers <- function(what, size, signed = TRUE) {
  function(bytes, n) readBin(bytes, what, n, size = size, signed = signed, endian = "little")
}

# place_by_row() converts bytes to integers later.
read_byte <- function(bytes, n) bytes

# R reads the smallest int32 as NA.
read_int32 <- function(bytes, n) {
  values <- readBin(bytes, "integer", n, size = 4L, endian = "little")
  if (anyNA(values)) signed_half(values) else values
}

read_uint32 <- function(bytes, n) {
  values <- readBin(bytes, "integer", n, size = 4L, endian = "little")
  wide <- anyNA(values) || any(values < 0L)
  if (wide) unsigned_half(values) else values
}

read_int64 <- function(signed) function(bytes, n) whole_from_halves(bytes, n, signed)

read_half <- function(bytes, n) {
  bits <- readBin(bytes, "integer", n, size = 2L, signed = FALSE, endian = "little")
  double_from_half(bits)
}

read_bool <- function(bytes, n) as.logical(bytes)

write_numbers <- function(as_type, size) {
  function(x) writeBin(as_type(x), raw(), size = size, endian = "little")
}

write_int32 <- function(x) {
  writeBin(int32_bits(as.double(x) %% 2^32), raw(), size = 4L, endian = "little")
}

write_half <- function(x) writeBin(half_from_double(x), raw(), size = 2L, endian = "little")

write_byte <- function(x) as.raw(as.integer(x) %% 256L)

write_int64 <- function(x) bytes_of_whole(x)

tensor_type <- function(size, read, write) list(size = size, read = read, write = write)

# For each dtype in a header: the bytes of a number, and the functions that read and write numbers.
tensor_types <- list(
  F64 = tensor_type(8L, read_numbers("double", 8L), write_numbers(as.double, 8L)),
  F32 = tensor_type(4L, read_numbers("double", 4L), write_numbers(as.double, 4L)),
  F16 = tensor_type(2L, read_half, write_half),
  I8 = tensor_type(1L, read_numbers("integer", 1L), write_byte),
  I16 = tensor_type(2L, read_numbers("integer", 2L), write_numbers(as.integer, 2L)),
  I32 = tensor_type(4L, read_int32, write_int32),
  I64 = tensor_type(8L, read_int64(TRUE), write_int64),
  U8 = tensor_type(1L, read_byte, write_byte),
  U16 = tensor_type(2L, read_numbers("integer", 2L, FALSE), write_numbers(as.integer, 2L)),
  U32 = tensor_type(4L, read_uint32, write_int32),
  U64 = tensor_type(8L, read_int64(FALSE), write_int64),
  BOOL = tensor_type(1L, read_bool, write_byte)
)

# Half precision: 1 bit of sign, 5 of exponent, 10 of fraction.
double_from_half <- function(bits) {
  exponent <- bits %/% 1024L %% 32L
  fraction <- bits %% 1024L
  values <- (1024 * (exponent > 0L) + fraction) * 2^(pmax(exponent, 1L) - 25)
  values[exponent == 31L] <- ifelse(fraction[exponent == 31L] == 0L, Inf, NaN)
  values * (1 - 2 * (bits >= 32768L))
}

half_from_double <- function(x) {
  x <- as.double(x)
  size <- abs(x)
  exponent <- pmax(floor(log2(size)), -14)
  # log2() may be rounded up to the next whole number just below a power of two.
  exponent <- exponent - (size < 2^exponent & exponent > -14)
  # round() takes the even neighbour, as floating-point numbers require.
  bits <- round(size / 2^(exponent - 10)) + (exponent + 14) * 1024
  bits[bits > 31744 | is.infinite(x)] <- 31744
  bits[is.nan(x)] <- 32256
  negative <- x < 0 | x == 0 & 1 / x < 0
  as.integer(bits + 32768 * (negative & !is.nan(x)))
}

# Writing -------------------------------------------------------------------------

#' Write a safetensors file
#'
#' @param tensors A named list of tensors, each a list of `dtype` (as in
#'   `tensor_types`), `shape` and `bytes`.
#' @param metadata A named character vector of JSON texts.
#' @return A raw vector. The header is padded with blanks, so that bodies of one layout usually have
#'   one length.
#' @noRd
write_tensors <- function(tensors, metadata) {
  sizes <- vapply(tensors, function(tensor) as.double(length(tensor$bytes)), 0)
  ends <- cumsum(sizes)
  table <- vapply(seq_along(tensors), function(i) {
    tensor <- tensors[[i]]
    sprintf(
      ",%s:{\"dtype\":\"%s\",\"shape\":[%s],\"data_offsets\":[%.0f,%.0f]}",
      json_string(names(tensors)[[i]]), tensor$dtype, paste(tensor$shape, collapse = ","),
      ends[[i]] - sizes[[i]], ends[[i]]
    )
  }, "")
  # The values are JSON texts: only their quotes and backslashes need escaping.
  metadata[] <- paste0("\"", gsub("([\"\\\\])", "\\\\\\1", enc2utf8(metadata)), "\"")
  header <- paste0(c("{\"__metadata__\":", json_object(metadata), table, "}"), collapse = "")
  header <- charToRaw(header)
  header <- c(header, rep(as.raw(0x20), -length(header) %% 64L))
  length_bytes <- writeBin(c(length(header), 0L), raw(), size = 4L, endian = "little")
  do.call(c, c(list(length_bytes, header), lapply(unname(tensors), `[[`, "bytes")))
}
