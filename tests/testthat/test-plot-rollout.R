rollout_of <- function(returns) {
  rollout(scripted_environment(returns), policy_random(), episodes = length(returns))
}

test_that("the picture shows the density of the returns, each of them, and their median", {
  returns <- c(10, 12.5, 13, 15, 16, 18, 20, 40)
  picture <- drawn(ggplot2::autoplot(rollout_of(returns)))
  whole <- density(returns, from = 10, to = 40)
  expect_equal(layers_of(picture, "GeomDensity")[[1]][c("x", "y")],
               data.frame(x = whole$x, y = whole$y), ignore_attr = TRUE)
  expect_identical(layers_of(picture, "GeomRug")[[1]]$x, returns)
  expect_identical(layers_of(picture, "GeomVline")[[1]]$xintercept, 15.5)
  expect_identical(picture$labels$title, "Fake-v0")
  expect_identical(picture$labels$subtitle, "policy: random, 8 episodes, median 15.5 (dashed)")
})

test_that("few different returns have a bar each, as high as the number of their episodes", {
  picture <- drawn(ggplot2::autoplot(rollout_of(rep(c(1.5, -1, 1, 0, -1), 8))))
  bars <- layers_of(picture, "GeomBar")[[1]]
  expect_equal((bars$xmin + bars$xmax) / 2, c(-1, 0, 1, 1.5))
  expect_equal(bars$ymax, c(16, 8, 8, 8))
  expect_equal(bars$xmax - bars$xmin, rep(0.4, 4))
  expect_identical(picture$labels$y, "episodes")
})

test_that("whole numbers are a histogram: a bar for each number, or for as many in a row", {
  returns <- c(9:20, 20, 31)
  picture <- drawn(ggplot2::autoplot(rollout_of(returns)))
  bars <- layers_of(picture, "GeomBar")[[1]]
  expect_equal(bars$x[bars$count > 0], c(9:20, 31))
  expect_equal(bars$count[bars$count > 0], c(rep(1, 11), 2, 1))
  expect_identical(picture$labels$y, "episodes")
  wide <- layers_of(ggplot2::autoplot(rollout_of(c(returns, 500))), "GeomBar")[[1]]
  width <- unique(round(wide$xmax - wide$xmin, 6))
  expect_identical(width, trunc(width))
  expect_equal(c(max(wide$xmax), sum(wide$count)), c(500.5, 15))
})

test_that("no bar is wider than what its returns may be", {
  widths <- vapply(list(200, c(200, 200), 0, c(0, 500)), bar_width, 0)
  expect_equal(widths, c(0.9, 0.9, 0.9, 5))
  expect_lt(bar_width(-962.6), 1)
})

test_that("bars are as few as are twice as many episodes on average, or three", {
  expect_true(has_few(c(9, 20, 31)))
  expect_false(has_few(c(9, 20, 31, 40)))
  expect_true(has_few(rep(1:10, 2)))
  expect_false(has_few(rep(1:11, 9)))
})

test_that("bars near each other are seen, and have the usual marks", {
  near <- c(rep(500, 20), 499.9, 9)
  expect_gt(bar_width(near), 4)
  expect_null(bar_marks(near))
  drawn(ggplot2::autoplot(rollout_of(near)))
})

test_that("equal returns, or a single one, have a bar with room beside it", {
  for (returns in list(200, rep(200, 5), 0)) {
    picture <- drawn(ggplot2::autoplot(rollout_of(returns)))
    bar <- layers_of(picture, "GeomBar")[[1]]
    range <- ggplot2::ggplot_build(picture)$layout$panel_params[[1]]$x.range
    expect_true(range[1] < bar$xmin && bar$xmax < range[2])
  }
})

test_that("a wrong type, or an argument of another type, is refused by name", {
  played <- rollout_of(1:3)
  expect_error(plot(played, type = "tree"),
               "one of \"returns\", \"trajectory\", \"filmstrip\", not \"tree\"",
               class = "gym_error_argument")
  expect_error(plot(played, col = "red"), "no argument for `col`", class = "gym_error_argument")
})
