test_that("numbers are rounded for printing, one by one where they stand apart", {
  expect_identical(number_text(12345.678), "12,346")
  expect_identical(number_text_each(c(a = 1, b = 0.125)), c("1", "0.125"))
  expect_identical(percent_text(0.331), "33%")
  expect_identical(se_text(0.5), " (standard error 0.5)")
  expect_null(se_text(NA_real_))
})

test_that("what is counted has its plural, and long times are minutes", {
  expect_identical(count_of(1, "step"), "1 step")
  expect_identical(count_of(0, "step"), "0 steps")
  expect_identical(count_of(1e6, "step"), "1,000,000 steps")
  expect_identical(seconds_text(3), "3.0 s")
  expect_identical(seconds_text(600), "10 min")
})
