test_that("negative actions of a batch are written, too", {
  write <- array_writer(space_discrete(3, start = -1), 3L)
  expect_identical(write(c(1, 0, -1)), as.raw(c(1, raw(7), raw(8), rep(0xff, 8))))
})
