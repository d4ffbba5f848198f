test_that("a generator goes on from where it was, and gives what its seed gives", {
  generator <- new_generator(7)
  drawn <- c(with_generator(generator, runif(2)), with_generator(generator, runif(1)))
  expect_identical(drawn, with_generator(new_generator(7), runif(3)))
  expect_false(identical(drawn, with_generator(new_generator(8), runif(3))))
})

test_that("each seed beyond set.seed()'s has a stream of its own", {
  seeds <- c(-1, 0, 1, 2, 2^31 - 1, 2^31, 2^31 + 1, 2^31 + 2, 2^32, 2^32 + 1, 2^40, 2^53)
  streams <- lapply(seeds, seed_stream)
  expect_length(unique(streams), length(seeds))
  expect_length(unique(vapply(streams, function(stream) {
    with_generator(new_generator(stream = stream), runif(1))
  }, 0)), length(seeds))
  # Written down, as it must stay the same.
  expect_identical(with_generator(new_generator(2^40), sample.int(1e6, 3)),
                   c(222100L, 199631L, 831809L))
})

test_that("what a seed gives is L'Ecuyer's stream, whatever the session's kinds are", {
  withr::local_preserve_seed()
  set.seed(7, "L'Ecuyer-CMRG", "Inversion", "Rejection")
  wanted <- list(runif(2), rnorm(2), sample.int(10))
  draw <- function() list(runif(2), rnorm(2), sample.int(10))
  for (kind in c("Mersenne-Twister", "Wichmann-Hill", "Knuth-TAOCP-2002", "L'Ecuyer-CMRG")) {
    suppressWarnings(RNGkind(kind, "Box-Muller", "Rounding"))
    state <- .Random.seed
    expect_identical(with_generator(new_generator(7), draw()), wanted)
    expect_identical(.Random.seed, state)
    expect_identical(RNGkind(), c(kind, "Box-Muller", "Rounding"))
  }
})

test_that("after an error both generators are where they should be", {
  set.seed(1)
  state <- .Random.seed
  generator <- new_generator(7)
  try(with_generator(generator, {
    runif(1)
    stop("no")
  }), silent = TRUE)
  expect_identical(.Random.seed, state)
  second <- with_generator(new_generator(7), runif(2))[2]
  expect_identical(with_generator(generator, runif(1)), second)
  keep_random_state(runif(3))
  expect_identical(.Random.seed, state)
})

test_that("a session that had drawn nothing has drawn nothing afterwards, and keeps its kinds", {
  withr::local_preserve_seed()
  RNGkind("Super-Duper", "Inversion", "Rejection")
  rm(".Random.seed", envir = globalenv())
  with_generator(new_generator(7), runif(3))
  expect_false(exists(".Random.seed", globalenv(), inherits = FALSE))
  expect_identical(RNGkind()[[1L]], "Super-Duper")
})

test_that("streams differ, and go on from where they were kept", {
  streams <- new_streams(1)
  states <- list(streams$agent$state, streams$seeds$state, take_stream(streams))
  with_generator(streams$agent, runif(3))
  again <- restore_streams(saved_streams(streams))
  expect_identical(take_stream(again), take_stream(streams))
  expect_identical(with_generator(again$agent, runif(2)), with_generator(streams$agent, runif(2)))
  states <- c(states, list(take_stream(streams)))
  expect_length(unique(states), 4)
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
