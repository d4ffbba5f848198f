all_bytes <- function(path) readBin(path, "raw", file.size(path))

test_that("files that PyPI's safetensors writes are read right, in every dtype", {
  client <- test_client()
  python <- the_session$servers[[client$remote_base]]$python
  path <- withr::local_tempfile(fileext = ".safetensors")
  has_safetensors <- processx::run(python, c("-c", "import safetensors"), error_on_status = FALSE)
  skip_if(has_safetensors$status != 0L, "no safetensors of PyPI; make test installs it")
  processx::run(python, c(test_path("write_safetensors.py"), path))
  file <- read_tensors(all_bytes(path))
  read <- file$tensors
  expect_identical(file$metadata[c("format", "said")], list(format = "np", said = "a \"quote\"}"))
  expect_identical(read$F64, c(NaN, Inf, -Inf, 0, 5e-324, 1 / 3))
  expect_identical(1 / read$F64[4], -Inf)
  expect_identical(read$F32[1, 1:2], c(3.4028234663852886e38, 1.401298464324817e-45))
  expect_identical(read$F32[2, ], c(-1, 2, 3))
  expect_identical(read$F16, c(65504, 5.9604644775390625e-08, -0.0999755859375, Inf, -Inf, 0))
  expect_identical(1 / read$F16[6], -Inf)
  expect_identical(read$I8, c(-128L, 127L))
  expect_identical(read$I16, c(-32768L, 32767L))
  expect_identical(read$I32, c(-2147483648, 2147483647))
  expect_identical(read[["I64 small"]], c(-2147483647L, -1L, 0L, 2147483647L))
  expect_identical(read[["I64 middle"]], c(1 - 2^53, -2^31, 2^32 - 1, 2^53 - 1))
  expect_identical(read$U8, aperm(array(0:23, c(4, 3, 2))))
  expect_identical(read$U16, c(0L, 65535L))
  expect_identical(read$U32, c(0, 2^31, 2^32 - 1))
  expect_identical(read$U64, c(2^32, 2^53 - 1))
  expect_identical(read$BOOL, matrix(c(TRUE, FALSE)))
  expect_identical(read$scalar, 7L)
  expect_identical(read[["empty/\u00e9"]], matrix(numeric(), 0, 3))
})

tensor <- function(dtype, shape, x) {
  list(dtype = dtype, shape = shape, bytes = tensor_types[[dtype]]$write(x))
}

test_that("halves round to the nearest, ties to the even, as NumPy's do", {
  x <- c(1, 1 + 2^-11, 1 + 3 * 2^-11, 65519, 65520, 2^-24, 2^-25, 2^-14 - 2^-26, -2^-24, NaN)
  back <- double_from_half(half_from_double(x))
  expect_identical(
    back, c(1, 1, 1 + 2^-9, 65504, Inf, 2^-24, 0, 2^-14, -2^-24, NaN)
  )
  bits <- setdiff(0:65535, c(31745:32767, 64513:65535))
  expect_identical(half_from_double(double_from_half(bits)), bits)
})

test_that("a file that is no file is an error", {
  good <- write_tensors(list(x = tensor("F32", 2L, 1:2)), c(request = "{}"))
  words <- charToRaw("{\"message\": \"no\"}")
  for (bad in list(raw(), good[1:7], good[1:20], head(good, -1), words)) {
    expect_error(read_tensors(bad), class = "gym_error_connection")
  }
})

test_that("integers beyond what R can hold are errors, never rounded", {
  read <- function(hex, signed) {
    bytes <- as.raw(strtoi(substring(hex, seq(15, 1, -2), seq(16, 2, -2)), 16))
    whole_from_halves(bytes, 1L, signed)
  }
  refused <- function(hex, signed, text) {
    expect_error(read(hex, signed), text, fixed = TRUE, class = "gym_error_space")
  }
  refused("ffffffffffffffff", FALSE, "An integer of about 1.84e+19 is beyond 2^53 - 1")
  refused("8000000000000000", FALSE, "about 9.22e+18")
  refused("8000000000000000", TRUE, "about -9.22e+18")
  refused("0020000000000000", TRUE, "about 9.01e+15")
  refused("0020000000000001", TRUE, "about 9.01e+15")
  expect_identical(read("001fffffffffffff", TRUE), 2^53 - 1)
})

test_that("a number that the dtype does not hold is no action, and names its place", {
  space <- new_space(describe_dict(a = describe_box(c(0, 0), c(9, 9), dtype = "uint8")))
  expect_error(to_tensors(space$spaces$a, c(3, 300), "action", NULL), "\\$\\[1\\]",
               class = "gym_error_space")
  narrow <- new_space(describe_box(-1e100, 1e100, dtype = "float32"))
  expect_error(to_tensors(narrow, 1e300, "action", NULL), class = "gym_error_space")
  expect_identical(length(to_tensors(narrow, Inf, "action", NULL)), 1L)
})

test_that("large observations arrive as integers, in their shape", {
  client <- test_client()
  skip_if_not(env_registry(client, "CarRacing-v3")$available[1], "the extra box2d")
  env <- local_env("CarRacing-v3", seed = 1)
  observation <- env$reset()
  expect_type(observation, "integer")
  expect_identical(dim(observation), c(96L, 96L, 3L))
})

test_that("a header that makes no sense is an error", {
  file_of <- function(header) {
    c(writeBin(c(nchar(header), 0L), raw(), endian = "little"), charToRaw(header), raw(16))
  }
  for (header in c(
    "[1]", "{\"x\":1}", "{\"x\":{\"dtype\":\"I32\"}}", "not JSON",
    "{\"x\":{\"dtype\":\"I32\",\"shape\":[1],\"data_offsets\":[-4,0]}}"
  )) {
    expect_error(read_tensors(file_of(header)), class = "gym_error_connection")
  }
})

test_that("the error for a number that a dtype cannot hold names the whole path", {
  space <- new_space(from_json(
    '{"name":"Dict","dtype":null,"spaces":[{"key":"a","space":{"name":"Box","dtype":"float32",
      "shape":[2],"low":[-1e100,-1e100],"high":[1e100,1e100]}}]}'
  ))
  error <- expect_error(to_tensors(space, list(a = c(0, 1e300)), "action", NULL),
                        class = "gym_error_space")
  expect_match(error$path, "a[1]", fixed = TRUE)
})

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
    header_of(dtype = "null"), header_of(dtype = "\"F9\""), header_of(shape = "[2]"),
    header_of(shape = "[\"a\"]"), header_of(offsets = "[0]"), header_of(offsets = "[0,9]"),
    header_of(more = ",\"__metadata__\":{"), header_of(more = ",\"y\":1"), "[]x", "\"x\""
  )
  for (header in headers) {
    expect_error(
      suppressWarnings(read_tensors(file_of(header, raw(8)))), "server's answer is invalid",
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
  expect_no_warning(expect_error(read_tensors(file), class = "gym_error"))
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
