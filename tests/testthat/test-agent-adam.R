test_that("Adam's steps are those of the paper's Algorithm 1", {
  set.seed(1)
  gradients <- matrix(rnorm(30), 3)
  weights <- wanted <- c(1, 2, 3)
  adam <- new_adam(3)
  m <- v <- 0
  for (t in 1:10) {
    g <- gradients[, t]
    moved <- adam_step(weights, g, adam, learning_rate = 0.1, epsilon = 1e-5)
    weights <- moved$weights
    adam <- moved$adam
    m <- 0.9 * m + (1 - 0.9) * g
    v <- 0.999 * v + (1 - 0.999) * g^2
    wanted <- wanted - 0.1 * (m / (1 - 0.9^t)) / (sqrt(v / (1 - 0.999^t)) + 1e-5)
    expect_equal(weights, wanted, tolerance = 1e-13)
  }
})

test_that("a gradient is cut to its greatest length, and a shorter one left alone", {
  expect_equal(clip_norm(c(3, 4), 1), c(0.6, 0.8), tolerance = 1e-6)
  expect_identical(clip_norm(c(3, 4), 6), c(3, 4))
  expect_identical(clip_norm(c(3, 4), Inf), c(3, 4))
})
