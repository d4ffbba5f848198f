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

test_that("an integer64 keeps its digits", {
  skip_if_not_installed("bit64")
  expect_equal(to_json(bit64::as.integer64("9007199254740993")), "9007199254740993")
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

test_that("a value that JSON has no form for is refused", {
  expect_error(to_json(quote(a)), class = "gym_error_argument")
})
