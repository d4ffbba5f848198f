test_that("code under a seed draws what it would draw after set.seed()", {
  set.seed(7)
  wanted <- runif(3)
  expect_identical(with_random_seed(7, runif(3)), wanted)
})

test_that("the session's generator is as it was after a seed of its own, also after an error", {
  set.seed(1)
  state <- .Random.seed
  with_random_seed(7, runif(3))
  expect_identical(.Random.seed, state)
  try(with_random_seed(7, stop(runif(1))), silent = TRUE)
  expect_identical(.Random.seed, state)
  keep_random_state(runif(3))
  expect_identical(.Random.seed, state)
})

test_that("a session that had drawn nothing has drawn nothing afterwards", {
  withr::local_preserve_seed()
  rm(".Random.seed", envir = globalenv())
  with_random_seed(7, runif(3))
  expect_false(exists(".Random.seed", globalenv(), inherits = FALSE))
})

test_that("without a seed code draws from the session's generator", {
  set.seed(1)
  with_random_seed(NULL, runif(2))
  third <- runif(1)
  set.seed(1)
  expect_identical(third, runif(3)[3])
})

test_that("the first seeds of environments do not depend on how many are drawn", {
  set.seed(1)
  few <- draw_environment_seeds(3)
  set.seed(1)
  many <- draw_environment_seeds(100)
  expect_identical(many[1:3], few)
  expect_type(many, "integer")
  expect_true(all(many >= 1))
})
