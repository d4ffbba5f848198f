# Makes an integer64, as bit64 and data.table do, without these packages. `x` must fit R's integers.
int64 <- function(x) {
  halves <- rbind(as.integer(x), -1L * (as.vector(x) < 0))
  bits <- writeBin(as.integer(halves), raw(), endian = "little")
  x[] <- as.double(x)
  x[] <- readBin(bits, "double", length(x), endian = "little")
  structure(x, class = "integer64")
}
