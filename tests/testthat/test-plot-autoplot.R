skip_if_not_installed("ggplot2")

# Builds and draws; warnings fail the test.
expect_drawn <- function(plot) {
  expect_s3_class(plot, "ggplot")
  local_device()
  expect_silent(print(plot))
}

test_that("returns are those of the episodes", {
  returns <- c(10, 12, 13, 15, 16, 18, 20, 40)
  played <- rollout(scripted_environment(returns), policy_random(), episodes = 8)
  plot <- ggplot2::autoplot(played)
  expect_drawn(plot)
  density <- returns_plot_data(played$episodes$return)$density
  expect_equal(ggplot2::layer_data(plot, 1)[c("x", "y")], density, ignore_attr = TRUE)
  expect_identical(ggplot2::layer_data(plot, 2)$x, returns)
  expect_identical(ggplot2::layer_data(plot, 3)$xintercept, 15.5)
  expect_drawn(ggplot2::autoplot(rollout(fake_environment(), policy_random())))
})

test_that("few different returns have a bar each", {
  returns <- rep(c(-1, 0, 1, -1), 5)
  plot <- ggplot2::autoplot(rollout(scripted_environment(returns), policy_random(), episodes = 20))
  expect_drawn(plot)
  expect_equal(ggplot2::layer_data(plot, 1)$ymax, c(10, 5, 5))
  expect_equal(ggplot2::layer_data(plot, 1)$xmin, c(-1, 0, 1) - 0.4)
  expect_length(plot$layers, 2)
})

test_that("a panel of a constant has a mark at its value alone", {
  played <- short_rollout()
  played$steps$cart_position <- 0L
  played$steps$cart_velocity <- 0.125
  plot <- ggplot2::autoplot(played, type = "trajectory")
  expect_drawn(plot)
  marks <- lapply(ggplot2::ggplot_build(plot)$layout$panel_params, function(panel) {
    Filter(Negate(is.na), panel$y$breaks)
  })
  expect_identical(marks[[1]], 0)
  expect_identical(marks[[2]], 0.125)
  expect_gt(length(marks[[3]]), 1)
})

test_that("a trajectory has the values of the steps, in a facet for each part", {
  played <- short_rollout()
  plot <- ggplot2::autoplot(played, type = "trajectory")
  expect_drawn(plot)
  lines <- ggplot2::layer_data(plot, 4)
  for (i in 1:4) {
    expect_identical(lines$y[lines$PANEL == i], played$steps[[2 + i]])
  }
  expect_identical(unique(lines$x), as.numeric(0:9))
  tiles <- ggplot2::layer_data(plot, 6)
  expect_identical(as.integer(tiles$y), played$steps$action)
  expect_identical(as.character(unique(tiles$PANEL)), "5")
  expect_identical(ggplot2::layer_data(plot, 3)$xintercept[[1]], 10)
  expect_identical(facet_labels(trajectory_plot_data(played))[["action"]],
                   "action: 0 push left, 1 push right")
})

test_that("limits are drawn in their own facets", {
  right <- function(observation) rep(1L, nrow(observation))
  plot <- ggplot2::autoplot(short_rollout(100, right), type = "trajectory")
  expect_drawn(plot)
  limits <- ggplot2::layer_data(plot, 1)
  angle <- limits$yintercept[limits$PANEL == 3]
  expect_equal(angle, c(-12, 12) * pi / 180)
})

test_that("other kinds of trajectories are drawn, too", {
  numbers <- fake_environment(
    observation_space = discrete_space(9L), action_space = box_space(c(-1, -1), c(1, 1))
  )
  plot <- ggplot2::autoplot(rollout(numbers, policy_random(), seed = 1, steps = TRUE),
                            type = "trajectory")
  expect_drawn(plot)
  colours <- unique(ggplot2::layer_data(plot, 7)$colour)
  expect_identical(colours, line_colours[1:2])
  expect_drawn(ggplot2::autoplot(rollout(fake_environment(), policy_random(), steps = TRUE),
                                 type = "trajectory"))
})

test_that("what cannot be drawn says so", {
  played <- rollout(fake_environment(), policy_random())
  expect_error(ggplot2::autoplot(played, type = "filmstrip"), "\"returns\", \"trajectory\"",
               class = "gym_error_argument")
  expect_error(ggplot2::autoplot(played, type = "trajectory"), "steps = TRUE",
               class = "gym_error_argument")
})

test_that("marks on an axis are whole numbers where some fit", {
  expect_identical(few_breaks(c(-0.5, 1.5)), 0:1)
  expect_identical(few_breaks(c(-2.4, 2.4)), -2:2)
  expect_identical(few_breaks(c(0.01, 0.09)), pretty(c(0.01, 0.09)))
  expect_identical(few_breaks(c(0, 100)), pretty(c(0, 100)))
})
