search_of <- function(returns, rounds, ...) {
  search_random(
    scripted_environment(returns), rounds = rounds, episodes = length(returns) / rounds, ...
  )
}

test_that("the plot shows every episode, each round's mean and the target", {
  search <- search_of(c(1, 5, 9, 2, 2, 2), rounds = 2, target = 20)
  data <- search_plot_data(search)
  expect_identical(data$points$return, c(1, 5, 9, 2, 2, 2))
  expect_identical(round(data$points$x), rep(c(1, 2), each = 3))
  expect_identical(data$means, data.frame(round = 1:2, mean_return = c(5, 2)))
  expect_identical(data$target, 20)
  expect_true(all(data$points$return >= data$ylim[1] & data$points$return <= data$ylim[2]))
  expect_gte(data$ylim[2], 20)
})

test_that("equal returns of a round lie side by side, others above each other", {
  points <- search_plot_data(search_of(c(1, 5, 9, 2, 2, 2), rounds = 2, target = 20))$points
  expect_identical(points$x[1:3], c(1, 1, 1))
  expect_length(unique(points$x[4:6]), 3)
  expect_equal(mean(points$x[4:6]), 2)
  expect_true(all(abs(points$x - points$round) < 0.5))
  many <- search_plot_data(search_of(rep(7, 200), rounds = 1))$points
  expect_true(all(abs(many$x - 1) < 0.5))
})

test_that("no target, or an infinite one, is not drawn", {
  expect_null(search_plot_data(search_of(1:4, rounds = 2))$target)
  data <- search_plot_data(search_of(1:4, rounds = 2, target = Inf))
  expect_null(data$target)
  expect_true(all(is.finite(data$ylim)))
})

test_that("any search plots, returns itself and leaves par and R's generator alone", {
  local_device()
  set.seed(1)
  searches <- list(
    search_of(1, rounds = 1), search_of(rep(7, 4), rounds = 2, target = 7),
    search_of(-(1:100), rounds = 20, target = -1)
  )
  graphics::plot.new()
  before <- graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd"))
  state <- .Random.seed
  for (search in searches) {
    expect_identical(expect_invisible(plot(search)), search)
  }
  expect_identical(.Random.seed, state)
  after <- graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd"))
  expect_identical(after, before)
})

test_that("titles, labels and limits can be chosen", {
  local_device()
  plot(search_of(1:4, rounds = 2), main = "mine", xlab = "a", ylab = "b", ylim = c(-50, 50))
  expect_equal(graphics::par("usr")[3:4], c(-54, 54))
})

test_that("the title says in which round a search was solved, or that it was not", {
  expect_identical(
    search_title(search_of(c(1, 9), rounds = 2, target = 9)),
    "Random search in Fake-v0: solved in round 2"
  )
  expect_identical(
    search_title(search_of(c(1, 9), rounds = 2, target = 10)),
    "Random search in Fake-v0: not solved in 2 rounds"
  )
  expect_identical(search_title(search_of(c(1, 9), rounds = 2)), "Random search in Fake-v0")
})

test_that("the legend fits a narrow plot and keeps above the data", {
  local_device()
  graphics::par(mfrow = c(1, 3))
  plot(search_of(c(1, 9), rounds = 2, target = 9))
  labels <- c("episode", "mean of the round", "target 9")
  placed <- legend_above(labels, "black", 16L, NA)
  sides <- graphics::grconvertX(0:1, "npc", "inches")
  expect_gte(placed$left + 1e-9, sides[1])
  expect_lte(placed$right - 1e-9, sides[2])
  expect_gt(placed$height - 0.5 * graphics::par("csi"), graphics::grconvertY(1, "npc", "inches"))
})

test_that("ggplot2 draws the same episodes, means and target", {
  skip_if_not_installed("ggplot2")
  search <- search_of(c(1, 5, 9, 2, 2, 2), rounds = 2, target = 20)
  plot <- ggplot2::autoplot(search)
  expect_identical(ggplot2::layer_data(plot, 1L)$y, search$episodes$return)
  expect_identical(ggplot2::layer_data(plot, 2L)$y, search$rounds$mean_return)
  expect_identical(ggplot2::layer_data(plot, 4L)$yintercept, 20)
  local_device()
  expect_silent(print(plot))
  expect_silent(print(ggplot2::autoplot(search, type = "network")))
})

test_that("the marks of rounds are whole numbers, from 1 to the last", {
  expect_equal(round_ticks(1), 1)
  expect_equal(round_ticks(3), 1:3)
  expect_equal(round_ticks(50), c(10, 20, 30, 40, 50))
  for (last in 1:60) {
    at <- round_ticks(last)
    expect_gt(length(at), 0)
    expect_true(all(at == round(at) & at >= 1 & at <= last))
  }
})
