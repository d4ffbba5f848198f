# Whole numbers are integers in R if they all fit, otherwise doubles. No number is ever rounded: a
# server's number beyond 2^53 - 1 is an error, and so is a user's integer64 of bit64.

integer_dtypes <- c("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")

are_whole <- function(x, min, max) {
  is.numeric(x) && !is_integer64(x) && is.null(dim(x)) && !anyNA(x) &&
    all(x >= min & x <= max & x == trunc(x))
}

narrow_whole <- function(numbers) {
  if (within_integer(numbers)) as.integer(numbers) else as.numeric(numbers)
}

within_integer <- function(x) {
  isTRUE(length(x) == 0L || min(x) >= -.Machine$integer.max && max(x) <= .Machine$integer.max)
}

# The decimal digits of whole numbers; text is returned unchanged.
whole_text <- function(x) if (is.character(x)) x else sprintf("%.0f", x)

# Refuses whole numbers from a server that R's doubles may have rounded: 2^53 + 1 is 2^53 in R.
check_exact <- function(numbers) {
  beyond <- abs(numbers) >= 2^53
  if (any(beyond)) {
    gym_abort(
      paste0("An integer of about ", format(numbers[beyond][[1L]], digits = 3L),
             " is beyond 2^53 - 1, where R's numbers have gaps."),
      class = "gym_error_space", call = NULL
    )
  }
}

# An integer64, such as a column from data.table or a database, keeps its whole numbers in the bits
# of doubles, which R's own functions read as doubles: 5 becomes 2.5e-323.
is_integer64 <- function(x) is.object(x) && inherits(x, "integer64")

integer64_hint <- function(x) {
  if (is_integer64(x)) "`bit64::as.double.integer64()` makes numbers of R of an integer64."
}

#' Refuse an integer64 where numbers come in, also in a list or a data frame
#' @return `x`.
#' @noRd
plain_numbers <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (is_integer64(x)) {
    abort_argument(x, "numbers of R", arg, call)
  }
  # This runs in each step, so the usual case is fast.
  if (is.list(x) && (is.data.frame(x) || !is.object(x))) {
    for (part in x) plain_numbers(part, arg, call)
  }
  x
}

# Integers of 64 bits as two halves -------------------------------------------------

# Reads each 64-bit integer as two R integers with the bits of an int32, in which NA is -2^31.
whole_from_halves <- function(bytes, n, signed) {
  halves <- readBin(bytes, "integer", 2L * n, size = 4L, endian = "little")
  lower <- halves[2L * seq_len(n) - 1L]
  upper <- halves[2L * seq_len(n)]
  # Do all fit R's integers?
  if (!anyNA(lower) && !anyNA(upper) && all(upper == if (signed) (lower < 0L) * -1L else 0L) &&
        (signed || all(lower >= 0L))) {
    return(lower)
  }
  numbers <- (if (signed) signed_half(upper) else unsigned_half(upper)) * 2^32 +
    unsigned_half(lower)
  check_exact(numbers)
  numbers
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
  upper <- floor(x / 2^32)
  halves <- rbind(int32_bits(x - upper * 2^32), int32_bits(upper %% 2^32))
  writeBin(as.vector(halves), raw(), size = 4L, endian = "little")
}

# The R integer with the bits of an unsigned number below 2^32. For 2^31 it is NA.
int32_bits <- function(x) {
  x <- x - (x >= 2^31) * 2^32
  x[x == -2^31] <- NA
  as.integer(x)
}

# Decimal points --------------------------------------------------------------------------

#' Run code that writes or reads numbers in texts for programs
#'
#' Such texts need a decimal point. `options(OutDec = )` and the locale's number format are for
#' people, but `as.character()`, `sprintf()`, `write.table()` and jsonlite use them, too.
#' @noRd
with_decimal_point <- function(code) {
  locale <- Sys.getlocale("LC_NUMERIC")
  if (locale != "C") {
    Sys.setlocale("LC_NUMERIC", "C")
    # R warns about any other locale.
    on.exit(suppressWarnings(Sys.setlocale("LC_NUMERIC", locale)))
  }
  if (getOption("OutDec") != ".") {
    old <- options(OutDec = ".")
    on.exit(options(old), add = TRUE)
  }
  code
}
