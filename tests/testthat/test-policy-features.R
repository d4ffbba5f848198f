tiles <- function(..., low = c(0, 0), high = c(1, 2)) {
  basis_of(tile_coding(...), box_space(low, high), NULL)
}

test_that("an observation lies in one tile of each tiling", {
  basis <- tiles(tilings = 4, bins = 5)
  points <- cbind(stats::runif(200), stats::runif(200, 0, 2))
  present <- basis$of(points, 200)
  expect_identical(dim(present), c(200L, 4L))
  expect_identical(basis$count, 4 * 36)
  for (tiling in 1:4) {
    expect_true(all(present[, tiling] > 36 * (tiling - 1) & present[, tiling] <= 36 * tiling))
  }
})

test_that("a single observation lies in the same tiles as one of many", {
  basis <- tiles(tilings = 4, bins = c(5, 3))
  points <- cbind(c(-9, 9, 1, stats::runif(50)), c(9, -9, 2, stats::runif(50, 0, 2)))
  alone <- t(apply(points, 1, function(point) basis$one(rbind(point))))
  expect_equal(alone, basis$of(points, 53))
})

test_that("the states of a Discrete are put together in groups", {
  basis <- basis_of(tile_coding(tilings = 1, bins = 4), space_discrete(8, 1), NULL)
  expect_identical(basis$of(1:8, 8)[, 1], rep(1:4, each = 2))
})

test_that("near points share tiles, and the nearer the more", {
  basis <- tiles(tilings = 8, bins = 4)
  shared <- function(a, b) sum(basis$of(rbind(a), 1) == basis$of(rbind(b), 1))
  expect_identical(shared(c(0.5, 1), c(0.5, 1)), 8L)
  expect_identical(shared(c(0.1, 0.2), c(0.9, 1.8)), 0L)
  # A whole tile apart nothing is shared, half a tile apart half of it.
  expect_identical(shared(c(0.5, 1), c(0.5 + 0.25, 1)), 0L)
  expect_identical(shared(c(0.51, 1), c(0.51 + 0.125, 1)), 4L)
})

test_that("numbers outside of the range lie in the tiles at its ends", {
  basis <- tiles(tilings = 2, bins = 3)
  expect_identical(basis$of(rbind(c(-9, -9)), 1), basis$of(rbind(c(0, 0)), 1))
  expect_identical(basis$of(rbind(c(99, 99)), 1), basis$of(rbind(c(1 - 1e-9, 2 - 1e-9)), 1))
  expect_identical(basis$of(rbind(c(1, 2)), 1), basis$of(rbind(c(99, 99)), 1))
})

test_that("ranges without bounds must be given", {
  expect_error(tiles(low = c(0, -Inf)), "Number 2 of an observation has no range",
               class = "gym_error_argument")
  space <- box_space(c(0, -Inf), c(1, Inf))
  basis <- basis_of(tile_coding(low = c(0, -3), high = c(1, 3)), space, NULL)
  expect_identical(basis$count, 8 * 81)
  expect_error(basis_of(tile_coding(), space_multi_binary(3), NULL), "a Box of one dimension",
               class = "gym_error_argument")
  expect_error(tile_coding(bins = 0), class = "gym_error_argument")
  expect_error(tile_coding(bins = integer()), class = "gym_error_argument")
  expect_error(tiles(bins = c(2, 3, 4)), "one number, or one for each of the 2",
               class = "gym_error_argument")
  wide <- box_space(rep(0, 20), rep(1, 20))
  expect_error(basis_of(tile_coding(), wide, NULL), "The tilings would have",
               class = "gym_error_argument")
  expect_output(print(tile_coding(4, 8)), "<features: tile coding, 4 tilings of 8>", fixed = TRUE)
})

test_that("a learner with tiles learns a value for each place", {
  agent <- agent_start(
    agent_q(discount = 1, learning_rate = 0.5, features = tile_coding(4, 4)),
    list(observation_space = box_space(c(0, 0), c(1, 1)), action_space = space_discrete(2))
  )
  learner <- learner_of(agent, stats::runif)
  x <- agent$basis$one(c(0.2, 0.2))
  learner$observe(x, 2L, 8, agent$basis$one(c(0.9, 0.9)), TRUE, TRUE, 1L, NULL)
  agent <- learner$export()
  value <- function(at) predict(agent_policy(agent), at, type = "output")[, 2]
  expect_equal(value(rbind(c(0.2, 0.2), c(0.9, 0.9))), c(4, 0))
  expect_identical(act(agent_policy(agent), c(0.2, 0.2)), 1L)
})

test_that("features of a user's own function can be evaluated before the first step", {
  agent <- agent_start(
    agent_q(features = function(observation) cbind(1, observation)),
    list(observation_space = box_space(c(0, 0), c(1, 1)), action_space = space_discrete(2))
  )
  policy <- agent_policy(agent)
  expect_identical(predict(policy, rbind(c(0.1, 0.2), c(0.3, 0.4))), c(0L, 0L))
})
