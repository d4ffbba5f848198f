# Values of spaces as tensors. Large values are sent as tensors, because parsing JSON takes longer
# the more numbers there are; reading raw bytes takes hardly longer.

# Milliseconds for a whole step with JSON and with tensors, by the number of numbers in the
# observation (R 4.2, waitress, two noisy cores; medians of 300, of 30 from 5,000 on):
#
#                4   100   200   500  1,000  5,000  28,224  100,800
#   float32
#     JSON     1.0   1.1   1.3   1.7    2.3   11.7    39.4
#     tensors  1.2   1.1   1.2   1.1    1.2    1.3     1.8
#   uint8
#     JSON     0.9   0.9   1.0   1.2    1.5    5.7    18.2      143
#     tensors  1.1   1.0   1.1   1.1    1.1    1.3     1.8      3.9
#
# An action of float32 takes 1.1 as JSON and 1.4 as tensors with 20 numbers, 1.9 and 1.8 with 200,
# 3.9 and 2.3 with 1,000.
tensors_pay_from <- 200

# Whether tensors can hold the values: all values of the space must have the same shape.
has_tensors <- function(space) !is.na(count_numbers(space))

# How many numbers the tensors of a value have; `NA` if tensors cannot hold such values.
count_numbers <- function(space) {
  if (inherits(space, "gym_space_array")) {
    prod(space$shape)
  } else if (inherits(space, "gym_space_discrete")) {
    1
  } else if (inherits(space, "gym_space_text")) {
    0
  } else if (has_parts(space)) {
    sum(vapply(space$spaces, count_numbers, 0))
  } else {
    NA_real_
  }
}

# The names of the tensors of parts: the name of the whole, followed by a JSON pointer.
part_names <- function(space, name) {
  keys <- names(space$spaces) %||% (seq_along(space$spaces) - 1L)
  keys <- gsub("/", "~1", gsub("~", "~0", keys, fixed = TRUE), fixed = TRUE)
  paste0(name, "/", keys, recycle0 = TRUE)
}

#' Read a value from an answer's tensors
#' @param answer A list of `tensors` and `texts`, named lists.
#' @noRd
from_tensors <- function(space, name, answer) UseMethod("from_tensors")

#' @exportS3Method
from_tensors.default <- function(space, name, answer) {
  value <- answer$tensors[[name]]
  shape <- space$shape
  if (length(value) != prod(shape) || !identical(dim(value), if (length(shape) > 1L) shape)) {
    abort_answer(paste0(
      "Its tensor \"", name, "\" has the shape ", shape_text(dim(value) %||% length(value)),
      ", not ", shape_text(shape %||% integer())
    ))
  }
  value
}

#' @exportS3Method
from_tensors.gym_space_text <- function(space, name, answer) check_text(answer$texts[[name]])

#' @exportS3Method
from_tensors.gym_space_tuple <- function(space, name, answer) {
  values <- Map(from_tensors, unname(space$spaces), part_names(space, name), list(answer))
  names(values) <- names(space$spaces)
  values
}

#' @exportS3Method
from_tensors.gym_space_dict <- from_tensors.gym_space_tuple

#' Put a checked value into tensors
#' @return A named list of tensors for [write_tensors()], and strings for texts.
#' @noRd
to_tensors <- function(space, value, name, call, path = "") UseMethod("to_tensors")

#' @exportS3Method
to_tensors.default <- function(space, value, name, call, path = "") {
  type <- tensor_dtypes[[space$dtype]]
  flat <- row_major(value)
  check_dtype(space, flat, value, call, path)
  tensor <- list(dtype = type, shape = space$shape, bytes = tensor_types[[type]]$write(flat))
  stats::setNames(list(tensor), name)
}

# A Discrete value is sent as 64 bits, for any dtype.
#' @exportS3Method
to_tensors.gym_space_discrete <- function(space, value, name, call, path = "") {
  space$shape <- integer()
  space$dtype <- if (space$dtype == "uint64") "uint64" else "int64"
  to_tensors.default(space, value, name, call, path)
}

#' @exportS3Method
to_tensors.gym_space_text <- function(space, value, name, call, path = "") {
  stats::setNames(list(enc2utf8(value)), name)
}

#' @exportS3Method
to_tensors.gym_space_tuple <- function(space, value, name, call, path = "") {
  keys <- names(space$spaces)
  paths <- if (is.null(keys)) {
    lapply(seq_along(space$spaces) - 1L, path_index, path = path)
  } else {
    lapply(keys, path_key, path = path)
  }
  parts <- Map(
    to_tensors, unname(space$spaces), unname(in_order(space, value)), part_names(space, name),
    list(call), paths
  )
  as.list(do.call(c, unname(parts)))
}

#' @exportS3Method
to_tensors.gym_space_dict <- to_tensors.gym_space_tuple

tensor_dtypes <- c(
  float64 = "F64", float32 = "F32", float16 = "F16", bool = "BOOL", int8 = "I8", int16 = "I16",
  int32 = "I32", int64 = "I64", uint8 = "U8", uint16 = "U16", uint32 = "U32", uint64 = "U64"
)

# Refuses a number that the dtype cannot hold: in bytes it would silently wrap around or overflow.
check_dtype <- function(space, flat, value, call, path = "") {
  lost <- !fits_dtype(as.double(flat), space$dtype)
  if (any(lost)) {
    at <- path_index(path, unravel(which(lost)[[1L]], space$shape))
    problem <- paste("There is a number that", space$dtype, "cannot represent")
    abort_space(space, value, problem, call, at)
  }
}

dtype_ranges <- list(
  int8 = c(-2^7, 2^7 - 1), int16 = c(-2^15, 2^15 - 1), int32 = c(-2^31, 2^31 - 1),
  int64 = c(-2^63, 2^63), uint8 = c(0, 2^8 - 1), uint16 = c(0, 2^16 - 1),
  uint32 = c(0, 2^32 - 1), uint64 = c(0, 2^64), bool = c(0, 1)
)

fits_dtype <- function(x, dtype) {
  range <- dtype_ranges[[dtype]]
  if (is.null(range)) {
    !is.finite(x) | is.finite(round_to_dtype(x, dtype))
  } else {
    x >= range[[1L]] & x <= range[[2L]] & x == trunc(x)
  }
}
