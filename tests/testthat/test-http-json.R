test_that("doubles keep 17 significant digits", {
  expect_equal(to_json(0.1), "0.10000000000000001")
  values <- c(1 / 3, pi * 1e300, .Machine$double.xmin, 5e-324, -0.1)
  back <- vapply(values, function(x) from_json(paste0("[", to_json(x), "]"))[[1]], numeric(1))
  expect_identical(back, values)
})

test_that("whole numbers are written as such", {
  expect_equal(to_json(5), "5")
  expect_equal(to_json(5L), "5")
  expect_equal(to_json(1e15), "1000000000000000")
})

test_that("numbers that JSON cannot write travel as words and come back", {
  expect_equal(to_json(c(NaN, Inf, -Inf, 1)), '["NaN","Infinity","-Infinity",1]')
  expect_identical(
    numbers_from_json(from_json(to_json(c(NaN, Inf, -Inf, 1 / 3)))),
    c(NaN, Inf, -Inf, 1 / 3)
  )
})

test_that("a named list is an object, an unnamed one an array", {
  expect_equal(
    to_json(list(a = 1, b = list(TRUE, "x", NULL), c = c(1, 2))),
    '{"a":1,"b":[true,"x",null],"c":[1,2]}'
  )
  expect_equal(to_json(list()), "[]")
  expect_equal(to_json(structure(list(), names = character())), "{}")
})

test_that("text is escaped and arrives as it was", {
  text <- "quote \" backslash \\ line\nbreak é 漢 \u2028"
  expect_identical(from_json(paste0("[", to_json(text), "]"))[[1]], text)
})

test_that("a vector of length one is a scalar unless wrapped in I()", {
  expect_equal(to_json("a"), '"a"')
  expect_equal(to_json(I("a")), '["a"]')
})

test_that("an array is nested row by row", {
  expect_equal(to_json(matrix(1:6, 2, byrow = TRUE)), "[[1,2,3],[4,5,6]]")
})

test_that("infos become vectors where they are arrays of plain values", {
  info <- info_from_json(from_json(
    '{"mask": [1, 0, 1], "words": ["a"], "mixed": [1, "a"], "deep": {"x": null}}'
  ))
  expect_identical(info$mask, c(1L, 0L, 1L))
  expect_identical(info$words, "a")
  expect_identical(info$mixed, list(1L, "a"))
  expect_null(info$deep$x)
})

test_that("arrays of equal arrays in an info become matrices and arrays", {
  read <- function(text) info_from_json(from_json(text))
  expect_identical(read('{"x": [[1, 2, 3], [4, 5, 6]]}')$x, matrix(1:6, 2, byrow = TRUE))
  expect_identical(read('{"x": [[[1], [2]], [[3], [4]]]}')$x, array(c(1L, 3L, 2L, 4L), c(2, 2, 1)))
  expect_identical(read('{"x": [[1], [2]]}')$x, matrix(1:2, 2))
  expect_identical(read('{"x": [[1, 2], [3]]}')$x, list(1:2, 3L))
  expect_identical(read('{"x": [[1, 2], ["a", "b"]]}')$x, list(1:2, c("a", "b")))
  expect_identical(read('{"x": [[true, false]]}')$x, matrix(c(TRUE, FALSE), 1))
  expect_identical(read('{"x": [{"a": 1}, {"a": 2}]}')$x, list(list(a = 1L), list(a = 2L)))
  expect_identical(read('{"x": [[1, 2.5], ["NaN", 0]]}')$x, matrix(c(1, NaN, 2.5, 0), 2))
  expect_identical(read('{"x": [1, [1, 2]]}')$x, list(1L, 1:2))
  expect_identical(read('{"x": [], "y": {}, "z": [[]]}')$x, list())
})

test_that("the words for numbers are numbers, and text beside other text", {
  read <- function(text) info_from_json(from_json(text))
  expect_identical(read('["NaN", 1, "-Infinity"]'), c(NaN, 1, -Inf))
  expect_identical(read('["NaN"]'), NaN)
  expect_identical(read('["NaN", "Nan"]'), c("NaN", "Nan"))
})

test_that("the sign of zero is kept", {
  expect_identical(1 / from_json(to_json(list(-0)))[[1]], -Inf)
})

test_that("text with control characters, quotes and emoji arrives as it was", {
  text <- c("tab\tquote\"back\\slash", "\x01\x1f\x7f", "\U1F600 \u00e9", "", "\\u0000")
  expect_identical(unlist(from_json(json_array(json_string(text)))), text)
  expect_error(from_json('["a\\u0000b"]'), "NUL", class = "gym_error_space")
})

test_that("an empty list with names is an object", {
  expect_identical(to_json(structure(list(), names = character())), "{}")
})

test_that("a value that JSON has no form for is refused", {
  expect_error(to_json(quote(a)), class = "gym_error_argument")
})

test_that("what is nested as deeply as honest servers nest it is read, and nothing deeper", {
  nested <- function(depth, open, close) paste0(strrep(open, depth), 1, strrep(close, depth))
  refused <- function(expr, levels) {
    expect_error(
      expr, paste("nested more than", levels, "levels deep"), class = "gym_error_connection"
    )
  }
  for (form in list(c("[", "]"), c("{\"a\":", "}"), c("[\"]\\\"]\",", "]"))) {
    text <- function(depth) nested(depth, form[[1L]], form[[2L]])
    expect_no_error(info_from_json(from_json(text(130L))))
    expect_no_error(from_json(text(deepest_json)))
    refused(info_from_json(from_json(text(deepest_json))), "160")
    refused(from_json(text(deepest_json + 1L)), "320")
    refused(from_json(text(20000L)), "320")
  }
  # Brackets in texts, and beside one another, nest nothing.
  text <- strrep("[{", 1000)
  expect_identical(from_json(paste0("[\"", text, "\"]")), list(text))
  expect_length(from_json(json_array(rep("[1]", 1000))), 1000)
})

test_that("a space nested as deeply as JSON may be is read", {
  levels <- 159L
  text <- paste0(strrep('{"name":"Tuple","spaces":[', levels), '{"name":"Discrete","n":2}',
                 strrep("]}", levels))
  expect_s3_class(read_space(list(space = from_json(text)), "space"), "gym_space_tuple")
})
