test_that("without infos an environment is reset and stepped as with them", {
  bare <- local_env(num_envs = 3, vectorization_mode = "sync", seed = 1)
  beside <- local_env(num_envs = 3, vectorization_mode = "sync", seed = 1)
  expect_identical(bare$reset(seed = 1:3, infos = FALSE), beside$reset(seed = 1:3))
  out <- bare$step(c(1, 0), which = c(1, 3), infos = FALSE)
  expect_identical(out, beside$step(c(1, 0), which = c(1, 3)))
  second <- c(FALSE, TRUE, FALSE)
  again <- beside$reset(seed = c(NA, 7, NA), mask = second)
  expect_identical(bare$reset(seed = c(NA, 7, NA), mask = second, infos = FALSE), again)
})

test_that("a sub-environment begins its next episodes by itself, from the seeds in its list", {
  poles <- local_env(num_envs = 2, vectorization_mode = "sync", autoreset_mode = "SameStep")
  alone <- local_env()
  first <- first_observation(poles, list(c(1, 5), 2))
  expect_identical(first[1, ], alone$reset(seed = 1))
  ended <- FALSE
  out <- list(done = c(FALSE, FALSE))
  while (!ended) {
    out <- poles$step(c(1, 1), which = if (isTRUE(out$done[2])) 1 else NULL)
    ended <- out$done[[1]]
  }
  expect_identical(out$observation[1, ], alone$reset(seed = 5))
  expect_false(identical(out$next_observation[1, ], out$observation[1, ]))
})

test_that("an action in another form than the last one is checked and sent", {
  poles <- local_env(num_envs = 2, seed = 1)
  poles$reset()
  for (action in list(c(1L, 0L), c(TRUE, FALSE), c(1, 0))) {
    expect_identical(dim(poles$step(action)$observation), c(2L, 4L))
  }
  expect_error(poles$step(c(0.5, 1)), class = "gym_error_space")
  expect_error(poles$step(c(NA, 1)), class = "gym_error_space")
  expect_error(poles$step(1), class = "gym_error_space")
})

test_that("tensors by column are what tensors by row are", {
  for (dtype in c("U8", "I64", "F32", "F64")) {
    values <- array(1:24, 2:4)
    write <- tensor_types[[dtype]]$write
    file <- function(shape, flat) {
      write_tensors(list(x = list(dtype = dtype, shape = shape, bytes = write(flat))), c(a = ""))
    }
    by_row <- read_tensors(file(2:4, row_major(values)))
    by_column <- read_tensors(file(4:2, as.vector(values)), by_column = TRUE)
    expect_identical(by_column, by_row)
    expect_equal(by_row$tensors$x, values)
  }
})

test_that("a Tuple or Dict of a single part stays one, step after step", {
  wrapped <- gym_wrap("Blackjack-v1", "FilterObservation", filter_keys = list(0))
  env <- gym_make(wrapped, num_envs = 3, autoreset_mode = "SameStep", client = test_client())
  withr::defer(env$close())
  env$reset(seed = 1)
  for (i in 1:4) {
    out <- env$step(c(0L, 1L, 1L))
    expect_type(out$observation, "list")
    expect_length(out$observation, 1L)
    expect_length(out$observation[[1L]], 3L)
    bare <- env$step(c(0L, 1L, 1L), infos = FALSE, finals = FALSE)
    expect_type(bare$observation, "list")
  }
})
