# Whole numbers of up to 64 bits in R: integer if they all fit, double up to 2^53, beyond it bit64's
# integer64. No number is ever rounded: a number that does not fit is an error.

integer_dtypes <- c("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")

are_whole <- function(x, min, max) {
  is.numeric(x) && !is_integer64(x) && is.null(dim(x)) && !anyNA(x) &&
    all(x >= min & x <= max & x == trunc(x))
}

# Returns whole numbers from their decimal digits.
whole_from_digits <- function(digits) {
  numbers <- as.numeric(digits)
  if (all(abs(numbers) < 2^53 | digits %in% c("9007199254740992", "-9007199254740992"))) {
    return(narrow_whole(numbers))
  }
  lost <- numbers == -2^63 & digits == "-9223372036854775808" |
    numbers >= 2^63 & !(nchar(digits) == 19L & digits <= "9223372036854775807")
  if (any(lost)) {
    abort_whole(digits[lost][[1L]])
  }
  check_bit64(digits[which.max(nchar(digits))])
  bit64::as.integer64(digits)
}

narrow_whole <- function(numbers) {
  if (within_integer(numbers)) as.integer(numbers) else as.numeric(numbers)
}

within_integer <- function(x) {
  isTRUE(length(x) == 0L || min(x) >= -.Machine$integer.max && max(x) <= .Machine$integer.max)
}

# `largest` is the largest of the numbers, as text.
check_bit64 <- function(largest, has_bit64 = requireNamespace("bit64", quietly = TRUE)) {
  if (!has_bit64) {
    gym_abort(
      c(
        paste0("The integer ", largest, " is beyond 2^53, where R's numbers have gaps."),
        i = "With the package bit64 installed it arrives exactly: install.packages(\"bit64\")."
      ),
      class = "gym_error_space",
      call = NULL
    )
  }
}

abort_whole <- function(digits) {
  reason <- if (startsWith(digits, "-")) {
    "is the smallest int64, which is bit64's NA: R cannot represent it."
  } else {
    "is a uint64 beyond 2^63 - 1, the largest that R and bit64 can represent."
  }
  gym_abort(paste("The integer", digits, reason), class = "gym_error_space", call = NULL)
}

# The decimal digits of whole numbers of any type; text is returned unchanged.
whole_text <- function(x) {
  if (is.character(x)) {
    x
  } else if (is_integer64(x <- narrow_integer64(x))) {
    as.character(x)
  } else {
    sprintf("%.0f", x)
  }
}

# Beyond 2^53 the numbers of an integer64 are rounded.
as_double <- function(x) as.double(double_from_integer64(x))

# integer64 -------------------------------------------------------------------------

# An integer64, such as a column from data.table or a database, keeps its whole numbers in the bits
# of doubles. R's own functions read these as doubles: 5 becomes 2.5e-323. So settings refuse it, by
# is_number() and are_whole(). Where numbers come in (actions, observations, rewards, seeds,
# weights, tables), plain_numbers() or narrow_integer64() converts it to doubles.

is_integer64 <- function(x) is.object(x) && inherits(x, "integer64")

# The numbers as doubles, those beyond 2^53 rounded, NA for NA; other values unchanged. In plain R,
# because bit64 may not be installed.
double_from_integer64 <- function(x) {
  if (!is_integer64(x)) {
    return(x)
  }
  x <- unclass(x)
  halves <- readBin(
    writeBin(as.vector(x), raw(), endian = "little"), "integer", 2L * length(x), endian = "little"
  )
  lower <- halves[c(TRUE, FALSE)]
  upper <- halves[c(FALSE, TRUE)]
  numbers <- signed_half(upper) * 2^32 + unsigned_half(lower)
  numbers[is.na(upper) & lower %in% 0L] <- NA
  # Names and dimensions stay.
  x[] <- numbers
  x
}

# The same if no number is rounded by it; otherwise the integer64.
narrow_integer64 <- function(x) {
  if (!is_integer64(x)) {
    return(x)
  }
  numbers <- double_from_integer64(x)
  # Rounding may have led to 2^53 itself.
  if (all(abs(numbers) < 2^53, na.rm = TRUE)) {
    return(numbers)
  }
  check_bit64(sprintf("%.0f", numbers[which.max(abs(numbers))]))
  x
}

# The same for all numbers of a value that may be a list or a data frame.
narrow_values <- function(x, narrow = narrow_integer64) {
  # In each step, so the usual case is fast.
  if (!is.object(x) && !is.list(x)) {
    x
  } else if (is.list(x) && (!is.object(x) || is.data.frame(x))) {
    x[] <- lapply(x, narrow_values, narrow)
    x
  } else {
    narrow(x)
  }
}

# Numbers for R's arithmetic: an integer64 as doubles, or an error; other values unchanged.
plain_numbers <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  numbers <- narrow_integer64(x)
  if (is_integer64(numbers)) {
    largest <- numbers[which.max(abs(double_from_integer64(numbers)))]
    gym_abort(
      c(paste0("`", arg, "` has the integer64 ", whole_text(largest),
               ", which is beyond 2^53, where R's numbers have gaps."),
        i = "`as.numeric()` rounds it to the nearest number that R has."),
      class = "gym_error_argument", argument = arg, value = x, call = call
    )
  }
  numbers
}

# As two halves of 32 bits ---------------------------------------------------------

# Reads 64-bit integers as two halves, R integers with the bits of an int32: NA is -2^31.
whole_from_halves <- function(bytes, n, signed) {
  halves <- readBin(bytes, "integer", 2L * n, size = 4L, endian = "little")
  lower <- halves[2L * seq_len(n) - 1L]
  upper <- halves[2L * seq_len(n)]
  if (halves_are_narrow(lower, upper, signed)) {
    return(lower)
  }
  numbers <- (if (signed) signed_half(upper) else unsigned_half(upper)) * 2^32 +
    unsigned_half(lower)
  # At 2^53 the sum is exact only if nothing was rounded away.
  if (all(abs(numbers) < 2^53 | abs(numbers) == 2^53 & unsigned_half(lower) == 0)) {
    return(numbers)
  }
  check_bit64(sprintf("%.0f", numbers[which.max(abs(numbers))]))
  lost <- if (signed) is.na(upper) & lower %in% 0L else is.na(upper) | upper < 0L
  if (any(lost)) {
    abort_whole(if (signed) "-9223372036854775808" else digits_of_halves(lower[lost], upper[lost]))
  }
  structure(readBin(bytes, "double", n, size = 8L, endian = "little"), class = "integer64")
}

# The decimal digits of the first of some uint64. 2^32 is 4294967296, and no product loses a digit.
digits_of_halves <- function(lower, upper) {
  upper <- unsigned_half(upper[[1L]])
  rest <- upper * 967296 + unsigned_half(lower[[1L]])
  sprintf("%.0f%06.0f", upper * 4294 + rest %/% 1e6, rest %% 1e6)
}

# Whether all numbers fit R's integers.
halves_are_narrow <- function(lower, upper, signed) {
  !anyNA(lower) && !anyNA(upper) && all(upper == (lower < 0L) * -1L) &&
    (signed || all(upper == 0L))
}

signed_half <- function(half) {
  least <- is.na(half)
  half <- as.double(half)
  half[least] <- -2^31
  half
}

unsigned_half <- function(half) {
  half <- signed_half(half)
  half + (half < 0) * 2^32
}

bytes_of_whole <- function(x) {
  if (is_integer64(x)) {
    return(writeBin(as.vector(unclass(x)), raw(), size = 8L, endian = "little"))
  }
  upper <- floor(x / 2^32)
  halves <- rbind(int32_bits(x - upper * 2^32), int32_bits(upper %% 2^32))
  writeBin(as.vector(halves), raw(), size = 4L, endian = "little")
}

# The R integer with the bits of an unsigned number below 2^32: NA is 2^31.
int32_bits <- function(x) {
  x <- x - (x >= 2^31) * 2^32
  x[x == -2^31] <- NA
  as.integer(x)
}
