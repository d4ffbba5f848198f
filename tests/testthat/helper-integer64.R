# Whole numbers as bit64 and data.table keep them, made without these packages; `x` fits R's
# integers.
int64 <- function(x) {
  halves <- rbind(as.integer(x), -1L * (as.vector(x) < 0))
  bits <- writeBin(as.integer(halves), raw(), endian = "little")
  x[] <- as.double(x)
  x[] <- readBin(bits, "double", length(x), endian = "little")
  structure(x, class = "integer64")
}

# 2^53 + 1, which no double is.
int64_beyond_double <- function() {
  bits <- writeBin(c(1L, 2097152L), raw(), endian = "little")
  structure(readBin(bits, "double", 1L, endian = "little"), class = "integer64")
}
