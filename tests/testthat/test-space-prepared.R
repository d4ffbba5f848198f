test_that("negative actions of a batch are written, too", {
  write <- array_writer(space_discrete(3, start = -1), 3L)
  expect_identical(write(c(1, 0, -1)), as.raw(c(1, raw(7), rep(0xff, 4))))
})

# Each space with batches of two values that belong to it, and ones that do not.
cases <- function() {
  list(
    list(space_discrete(3, start = 1), good = list(c(1, 3), c(1L, 2L)),
         bad = list(c(0, 1), c(1, 4), 1, c(1, 1.5), c(1, NA), c("1", "2"), matrix(1, 2, 1),
                    list(1, 2))),
    list(space_box(c(0, -Inf), c(1, 5)), good = list(matrix(c(0, 1, -Inf, 5), 2), matrix(0L, 2, 2)),
         bad = list(matrix(c(0, 2, 0, 0), 2), matrix(c(0, 0, 0, 6), 2), c(0, 0), matrix(0, 2, 3),
                    matrix(c(0, NaN, 0, 0), 2), matrix(FALSE, 2, 2))),
    list(space_box(0, 1), good = list(c(0, 1), matrix(0, 2, 1)), bad = list(c(0, 2), c(0, 0, 0))),
    list(space_box(0, 9, shape = c(2, 3), dtype = "uint8"), good = list(array(9, c(2, 2, 3))),
         bad = list(array(10, c(2, 2, 3)), array(0.5, c(2, 2, 3)), matrix(0, 2, 6))),
    list(space_multi_discrete(c(2, 3)), good = list(matrix(c(1, 1, 2, 2), 2), matrix(TRUE, 2, 2)),
         bad = list(matrix(2, 2, 2), matrix(-1, 2, 2))),
    list(space_dict(a = space_discrete(2), b = space_box(0, 1, shape = 2)),
         good = list(list(a = c(0, 1), b = matrix(0, 2, 2))),
         bad = list(list(a = c(0, 2), b = matrix(0, 2, 2)), list(a = c(0, 1), b = matrix(2, 2, 2)),
                    list(a = c(0, 1)), c(0, 1)))
  )
}

test_that("the quick check agrees with the slow one", {
  skip_unless_all()
  slow <- function(space, batch) {
    tryCatch(
      {
        check_batch(space, batch_space(space, 2L), batch, 2L, NULL, bounds = TRUE)
        TRUE
      },
      gym_error_space = function(cnd) FALSE
    )
  }
  for (case in cases()) {
    quick <- quick_check(case[[1]])
    for (batch in case$good) {
      expect_true(quick(batch, 2L))
      expect_true(slow(case[[1]], batch))
    }
    for (batch in case$bad) {
      expect_false(quick(batch, 2L))
      expect_false(slow(case[[1]], batch))
    }
  }
})

test_that("bounds that differ are compared for any number of values", {
  quick <- quick_check(space_box(c(0, 10), c(1, 11)))
  for (n in c(1L, 5L, 2L, 5L)) {
    expect_true(quick(matrix(rep(c(1, 11), each = n), n), n))
    expect_false(quick(matrix(rep(c(1, 9), each = n), n), n))
  }
})
