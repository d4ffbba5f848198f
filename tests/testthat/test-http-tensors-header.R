file_of <- function(header, data = raw()) {
  header <- charToRaw(header)
  c(writeBin(c(length(header), 0L), raw(), size = 4L, endian = "little"), header, data)
}

header_of <- function(dtype = "\"F64\"", shape = "[1]", offsets = "[0,8]", more = "") {
  sprintf("{\"x\":{\"dtype\":%s,\"shape\":%s,\"data_offsets\":%s}%s}", dtype, shape, offsets, more)
}

test_that("a header that is right is read", {
  expect_identical(read_tensors(file_of(header_of(), raw(8)))$tensors, list(x = 0))
  empty <- read_tensors(file_of(header_of(shape = "[0,3]", offsets = "[0,0]")))$tensors$x
  expect_identical(dim(empty), c(0L, 3L))
})

test_that("a header that is nearly right is refused in words", {
  headers <- c(
    vapply(c("8", "null", "[0,8]", "[\"F64\"]", "\"\"", "\"F9\"", "{}"), function(dtype) {
      header_of(dtype = dtype)
    }, ""),
    vapply(c("1", "null", "{}", "[null]", "[true]", "[\"1\"]", "[[1]]", "[0.5,2]", "[-1,-1]",
             "[1e400]", "[99999999999999999999]", "[2]"), function(shape) {
      header_of(shape = shape)
    }, ""),
    vapply(c("8", "null", "{}", "[0]", "[0,4,8]", "[-8,0]", "[8,0]", "[0,4294967304]",
             "[null,8]", "[\"0\",\"8\"]", "[0,9]"), function(offsets) {
      header_of(offsets = offsets)
    }, ""),
    header_of(shape = "[4294967296,0]", offsets = "[0,0]"),
    header_of(more = ",\"__metadata__\":{"),
    header_of(more = ",\"y\":1"),
    "[]x", "{]", "\"x\"", "12"
  )
  for (header in headers) {
    expect_error(
      read_tensors(file_of(header, raw(8))), "tensors that came cannot be read",
      class = "gym_error_connection", info = header
    )
  }
})

test_that("a file that ends too early is refused in words", {
  file <- file_of(header_of(), raw(8))
  for (size in seq(0, length(file) - 1L)) {
    expect_error(read_tensors(file[seq_len(size)]), class = "gym_error_connection", info = size)
  }
})

test_that("a header that is no UTF-8 is refused without a warning", {
  bytes <- c(charToRaw("{\"x\\u0000"), as.raw(0xe8), charToRaw("\":1}"))
  file <- c(writeBin(c(length(bytes), 0L), raw(), size = 4L, endian = "little"), bytes)
  expect_no_warning(expect_error(read_tensors(file), class = "gym_error_connection"))
})

# A header of tensors of one byte each, at these places in the data.
bytes_at <- function(begins) {
  entries <- sprintf(
    "\"t%d\":{\"dtype\":\"U8\",\"shape\":[1],\"data_offsets\":[%d,%d]}",
    seq_along(begins), begins, begins + 1L
  )
  paste0("{", paste(entries, collapse = ","), "}")
}

test_that("tensors are read in any order, and fill the data", {
  in_any_order <- read_tensors(file_of(bytes_at(c(1L, 0L)), as.raw(1:2)))$tensors
  expect_identical(in_any_order[c("t1", "t2")], list(t1 = 2L, t2 = 1L))
  expect_error(
    read_tensors(file_of(bytes_at(0:1), raw(3))), "have 2 bytes", class = "gym_error_connection"
  )
})

test_that("neither many tensors nor much metadata take the session's time and memory", {
  skip_unless_all()
  many <- function(n) file_of(bytes_at(seq_len(n) - 1L), raw(n))
  # Ten seconds, where each is looked for by its name.
  expect_lt(system.time(read_tensors(many(15000L)))[["user.self"]], 4)
  expect_error(read_tensors(many(20000L)), "16,384 tensors", class = "gym_error_connection")
  withr::local_options(gym.max_answer_bytes = 2^20)
  long <- sprintf(",\"__metadata__\":{\"info\":\"%s\"}", strrep(" ", 2^17))
  expect_error(
    read_tensors(file_of(header_of(more = long), raw(8))), "larger than 65,536 bytes",
    class = "gym_error_connection"
  )
})
