# safetensors files: the length of a header (8 bytes), the header (JSON: name to
# dtype, shape and place), then the bytes of the tensors, little-endian and row
# by row. https://huggingface.co/docs/safetensors

# Reading -----------------------------------------------------------------------

#' Read a safetensors file
#'
#' @param bytes A raw vector.
#' @param layouts An environment that remembers the headers read last, `NULL` for
#'   none: a header seen before is not parsed again. Metadata at its end, where
#'   our server puts them, differ from answer to answer and are not compared.
#' @param expected JSON text of the metadata of an answer that says nothing more than its
#'   tensors: metadata that are equal to it are not parsed. `NULL` for none.
#' @return A list of `tensors`, a named list of vectors and arrays, and
#'   `metadata`, a named list of strings, `NULL` for the `expected` ones.
#' @noRd
read_tensors <- function(bytes, layouts = NULL, expected = NULL) {
  size <- header_size(bytes)
  data <- 8L + size
  header <- bytes[8L + seq_len(size)]
  if (any(header == as.raw(0L))) {
    abort_tensors("the header is no JSON")
  }
  layout <- known_layout(header, layouts)
  if (layout$end > length(bytes) - data) {
    abort_tensors("an offset lies outside of the file")
  }
  tensors <- read_entries(layout$entries, bytes, data)
  if (layout$metadata_last && ends_as(header, length(layout$start), expected)) {
    return(list(tensors = tensors))
  }
  list(tensors = tensors, metadata = last_metadata(header, layout) %||% layout$metadata)
}

# Up to this size tensors are taken out by an index, which lists the places of all their bytes; from
# a larger file by a connection of R's, which copies the file once.
index_up_to <- 65536L

read_entries <- function(entries, bytes, data) {
  large <- length(bytes) > index_up_to
  if (large) {
    file <- rawConnection(bytes)
    on.exit(close(file))
  }
  for (name in names(entries)) {
    entry <- entries[[name]]
    part <- if (large) {
      seek(file, data + entry$begin)
      readBin(file, "raw", entry$size)
    } else {
      bytes[data + entry$begin + seq_len(entry$size)]
    }
    entries[[name]] <- entry$read(part, entry$n, entry$shape)
  }
  entries
}

# Whether a header continues with a text from a place on, and has only blanks after it.
ends_as <- function(header, after, text) {
  if (is.null(text)) {
    return(FALSE)
  }
  text <- charToRaw(text)
  rest <- header[-seq_len(after)]
  n <- length(text)
  length(rest) >= n && identical(rest[seq_len(n)], text) && all(rest[-seq_len(n)] == as.raw(0x20))
}

# The types -----------------------------------------------------------------------

read_double <- function(size) {
  function(bytes, n, shape) {
    shape_values(readBin(bytes, "double", n, size = size, endian = "little"), shape)
  }
}

read_integer <- function(size, signed = TRUE) {
  function(bytes, n, shape) {
    values <- readBin(bytes, "integer", n, size = size, signed = signed, endian = "little")
    shape_values(values, shape)
  }
}

# The array is transposed while it is still bytes, a fourth of the size of integers.
read_byte <- function(bytes, n, shape) {
  if (length(shape) > 1L) {
    bytes <- shape_values(bytes, shape)
    array(as.integer(bytes), shape)
  } else {
    as.integer(bytes)
  }
}

# The bits of the smallest int32 are R's NA.
read_int32 <- function(bytes, n, shape) {
  values <- readBin(bytes, "integer", n, size = 4L, endian = "little")
  shape_values(if (anyNA(values)) signed_half(values) else values, shape)
}

read_uint32 <- function(bytes, n, shape) {
  values <- readBin(bytes, "integer", n, size = 4L, endian = "little")
  wide <- anyNA(values) || any(values < 0L)
  shape_values(if (wide) unsigned_half(values) else values, shape)
}

read_int64 <- function(signed) {
  function(bytes, n, shape) shape_values(whole_from_halves(bytes, n, signed), shape)
}

read_half <- function(bytes, n, shape) {
  bits <- readBin(bytes, "integer", n, size = 2L, signed = FALSE, endian = "little")
  shape_values(double_from_half(bits), shape)
}

read_bool <- function(bytes, n, shape) shape_values(bytes != as.raw(0L), shape)

write_double <- function(size) {
  function(x) writeBin(as.double(x), raw(), size = size, endian = "little")
}

write_integer <- function(size) {
  function(x) writeBin(as.integer(x), raw(), size = size, endian = "little")
}

write_int32 <- function(x) {
  writeBin(int32_bits(as_double(x) %% 2^32), raw(), size = 4L, endian = "little")
}

write_half <- function(x) writeBin(half_from_double(x), raw(), size = 2L, endian = "little")

write_byte <- function(x) as.raw(as.integer(x) %% 256L)

write_int64 <- function(x) bytes_of_whole(x)

# By the name in a header: how many bytes a number has, how it is read and written.
tensor_types <- list(
  F64 = list(size = 8L, read = read_double(8L), write = write_double(8L)),
  F32 = list(size = 4L, read = read_double(4L), write = write_double(4L)),
  F16 = list(size = 2L, read = read_half, write = write_half),
  I8 = list(size = 1L, read = read_integer(1L), write = write_byte),
  I16 = list(size = 2L, read = read_integer(2L), write = write_integer(2L)),
  I32 = list(size = 4L, read = read_int32, write = write_int32),
  I64 = list(size = 8L, read = read_int64(TRUE), write = write_int64),
  U8 = list(size = 1L, read = read_byte, write = write_byte),
  U16 = list(size = 2L, read = read_integer(2L, signed = FALSE), write = write_integer(2L)),
  U32 = list(size = 4L, read = read_uint32, write = write_int32),
  U64 = list(size = 8L, read = read_int64(FALSE), write = write_int64),
  BOOL = list(size = 1L, read = read_bool, write = write_byte)
)

# Halves: 1 bit of sign, 5 of exponent, 10 of fraction.
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
  # log2() may be a whole number too large just below a power of two.
  exponent <- exponent - (size < 2^exponent & exponent > -14)
  # round() takes the even neighbour, as floating-point numbers want it.
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
#' @return A raw vector. The header is filled up with blanks, so that bodies of
#'   one layout have one length as a rule.
#' @noRd
write_tensors <- function(tensors, metadata) {
  # In a JSON text no other characters need escaping.
  quoted <- gsub("\\", "\\\\", enc2utf8(metadata), fixed = TRUE)
  quoted <- gsub("\"", "\\\"", quoted, fixed = TRUE)
  about <- paste0("\"", names(metadata), "\":\"", quoted, "\"", collapse = ",")
  header <- charToRaw(paste0("{\"__metadata__\":{", about, "}", tensors_table(tensors), "}"))
  header <- c(header, rep(as.raw(0x20), -length(header) %% 64L))
  length_bytes <- writeBin(c(length(header), 0L), raw(), size = 4L, endian = "little")
  do.call(c, c(list(length_bytes, header), lapply(unname(tensors), `[[`, "bytes")))
}

# The header's table of tensors that was written last: from step to step it is the same.
written <- new.env(parent = emptyenv())

tensors_table <- function(tensors) {
  forms <- lapply(tensors, function(tensor) tensor[c("dtype", "shape")])
  if (!identical(forms, written$forms)) {
    written$table <- write_table(tensors)
    written$forms <- forms
  }
  written$table
}

write_table <- function(tensors) {
  sizes <- vapply(tensors, function(tensor) as.double(length(tensor$bytes)), 0)
  ends <- cumsum(sizes)
  entries <- vapply(seq_along(tensors), function(i) {
    tensor <- tensors[[i]]
    sprintf(
      ",%s:{\"dtype\":\"%s\",\"shape\":[%s],\"data_offsets\":[%.0f,%.0f]}",
      json_string(names(tensors)[[i]]), tensor$dtype, paste(tensor$shape, collapse = ","),
      ends[[i]] - sizes[[i]], ends[[i]]
    )
  }, "")
  paste(entries, collapse = "")
}
