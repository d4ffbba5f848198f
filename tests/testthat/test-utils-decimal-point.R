expect_decimal_points <- function() {
  expect_identical(to_json(list(a = 0.5, b = 1e5)), '{"a":0.5,"b":100000}')
  expect_identical(from_json('{"a":[0.5,-1.25e3]}'), list(a = list(0.5, -1250)))
  expect_identical(option_text(c(0.5, 1e5)), c("0.5", "100000"))
  expect_identical(query_text(list(a = 0.5)), "?a=0.5")
  expect_identical(csv_lines(data.frame(a = 0.5, b = 1e5))[[2]], "0.5,100000")
  # For people they are as everywhere in the session.
  expect_identical(number_text(0.5), "0,5")
}

test_that("in a locale with a decimal comma programs get a decimal point", {
  local_locale("LC_NUMERIC", "de_DE", "ISO-8859-1")
  expect_identical(sprintf("%.1f", 0.5), "0,5")
  expect_decimal_points()
  expect_identical(sprintf("%.1f", 0.5), "0,5")
  expect_identical(getOption("OutDec"), ".")
})

test_that("with options(OutDec) programs get a decimal point", {
  withr::local_options(OutDec = ",")
  expect_decimal_points()
  expect_identical(getOption("OutDec"), ",")
})
