rollout_of <- function(returns) {
  rollout(scripted_environment(returns), policy_random(), episodes = length(returns))
}

test_that("the plot shows the density of the returns and their median", {
  returns <- c(10, 12, 13, 15, 16, 18, 20, 40)
  data <- returns_plot_data(returns)
  expect_identical(data$returns, returns)
  expect_identical(data$median, 15.5)
  whole <- density(returns, from = 10, to = 40)
  expect_identical(data$density, data.frame(x = whole$x, y = whole$y))
  expect_identical(range(data$density$x), c(10, 40))
  expect_gt(data$ylim[2], max(data$density$y))
})

test_that("few different returns have a bar each, as high as the number of their episodes", {
  data <- returns_plot_data(rep(c(0, 1, 0), 20))
  expect_null(data$density)
  expect_equal(data$bars, data.frame(
    value = 0:1, episodes = c(40L, 20L), xmin = c(-0.4, 0.6), xmax = c(0.4, 1.4)
  ))
  expect_identical(bar_marks(data$bars), c(0, 1))
  expect_identical(returns_measure(data), "episodes")
  blackjack <- returns_plot_data(rep(c(1.5, -1, 1, 0, -1), 8))
  expect_identical(blackjack$bars$value, c(-1, 0, 1, 1.5))
  expect_identical(blackjack$bars$episodes, c(16L, 8L, 8L, 8L))
})

test_that("bars are as few as are twice as many episodes on average, or three", {
  has_bars <- function(returns) !is.null(returns_plot_data(returns)$bars)
  expect_true(has_bars(c(9, 20, 31)))
  expect_false(has_bars(c(9, 20, 31, 40)))
  expect_true(has_bars(rep(1:10, 2)))
  expect_false(has_bars(rep(1:11, 9)))
})

test_that("bars near each other are seen, and have the usual marks", {
  bars <- returns_plot_data(c(rep(500, 20), 499.9, 9))$bars
  expect_gt(min(bars$xmax - bars$xmin), 4)
  expect_null(bar_marks(bars))
})

test_that("equal returns, or a single one, have a bar with room beside it", {
  for (returns in list(200, rep(200, 5), 0)) {
    data <- returns_plot_data(returns)
    expect_identical(data$bars$episodes, length(returns))
    expect_true(data$xlim[1] < data$bars$xmin && data$bars$xmax < data$xlim[2])
  }
})

test_that("axes of bars can be left out as ever", {
  expect_identical(own_axes(list(xlim = 0:1)), c("xaxt", "yaxt"))
  expect_identical(own_axes(list(xaxt = "n")), "yaxt")
  expect_null(own_axes(list(axes = FALSE)))
})

test_that("any rollout plots, returns itself and leaves par and R's generator alone", {
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  graphics::plot.new()
  set.seed(1)
  played <- list(rollout_of(1), rollout_of(rep(-5, 3)), rollout_of(c(1, 2)), rollout_of(rexp(500)),
                 rollout_of(rep(0:1, 9)))
  before <- graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd"))
  state <- .Random.seed
  for (one in played) {
    expect_identical(expect_invisible(plot(one)), one)
  }
  expect_identical(.Random.seed, state)
  after <- graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd"))
  expect_identical(after, before)
})

test_that("the title names the environment and the policy", {
  expect_identical(played_title(rollout_of(1)), "Fake-v0, policy: random")
  env <- fake_environment(id = "CartPole-v1")
  expect_identical(
    played_title(rollout(env, policy_network())), "CartPole-v1, policy: network 4-2-1"
  )
})

test_that("a wrong type, or an argument of another type, is refused by name", {
  played <- rollout_of(1:3)
  expect_error(plot(played, type = "landscape"),
               "one of \"returns\", \"trajectory\", \"filmstrip\", not \"landscape\"",
               class = "gym_error_argument")
  expect_error(plot(played, type = "trajectory", xlim = 1:2), "`xlim`",
               class = "gym_error_argument")
})
