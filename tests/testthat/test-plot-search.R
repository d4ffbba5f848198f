autoplot <- ggplot2::autoplot

search_of <- function(returns, rounds, ...) {
  search_random(
    scripted_environment(returns), rounds = rounds, episodes = length(returns) / rounds, ...
  )
}

test_that("the picture shows every episode, each round's mean and the target", {
  search <- search_of(c(1, 5, 9, 2, 2, 2), rounds = 2, target = 20)
  picture <- drawn(autoplot(search))
  points <- layers_of(picture, "GeomPoint")
  expect_identical(points[[1]]$y, c(1, 5, 9, 2, 2, 2))
  expect_identical(round(points[[1]]$x), rep(c(1, 2), each = 3))
  expect_identical(layers_of(picture, "GeomLine")[[1]]$y, c(5, 2))
  expect_identical(layers_of(picture, "GeomHline")[[1]]$yintercept, 20)
  expect_identical(key_of(picture), c("episode", "mean of the round", "target 20"))
})

test_that("a search of one round has its mean as a point, without a message", {
  picture <- drawn(autoplot(search_of(c(7, 9), rounds = 1, target = 5)))
  expect_identical(layers_of(picture, "GeomPoint")[[2]]$y, 8)
})

test_that("equal returns of a round lie side by side, others above each other", {
  points <- search_points(search_of(c(1, 5, 9, 2, 2, 2), rounds = 2), 20)
  expect_identical(points$x[1:3], c(1, 1, 1))
  expect_length(unique(points$x[4:6]), 3)
  expect_equal(mean(points$x[4:6]), 2)
  expect_true(all(abs(points$x - points$round) < 0.5))
  many <- search_points(search_of(rep(7, 200), rounds = 1), NULL)
  expect_true(all(abs(many$x - 1) < 0.5))
})

test_that("no target, or an infinite one, has neither a line nor a key", {
  for (target in list(NULL, Inf)) {
    picture <- drawn(autoplot(search_of(1:4, rounds = 2, target = target)))
    expect_length(layers_of(picture, "GeomHline"), 0)
    expect_identical(key_of(picture), c("episode", "mean of the round"))
  }
})

test_that("the subtitle says in which round a search was solved, or that it was not", {
  outcome <- function(...) autoplot(search_of(c(1, 9), rounds = 2, ...))$labels$subtitle
  expect_identical(outcome(target = 9), "solved in round 2")
  expect_identical(outcome(target = 10), "not solved in 2 rounds")
  expect_null(outcome())
})

test_that("a search shows its network", {
  search <- search_random(fake_environment(id = "CartPole-v1"), rounds = 2, seed = 1)
  expect_length(layers_of(drawn(autoplot(search, type = "network")), "GeomSegment"), 1)
  expect_error(plot(search, type = "tree"), "`type`", class = "gym_error_argument")
})
