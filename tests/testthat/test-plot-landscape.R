landscape_of <- function(mean_return, target = NULL) {
  n <- sqrt(length(mean_return))
  steps <- seq(-1, 1, length.out = n)
  structure(
    list(
      grid = data.frame(expand.grid(a = steps, b = steps), mean_return = mean_return),
      best = mean_return[[(n^2 + 1) / 2]], env_id = "Fake-v0", target = target, episodes = 2L,
      common = TRUE, elapsed = 1, interrupted = FALSE
    ),
    class = "gym_landscape"
  )
}

test_that("the picture's field has a row for each step of the first direction", {
  data <- landscape_plot_data(landscape_of(1:9, target = 6.5))
  expect_identical(data$z, matrix(1:9, 3))
  expect_identical(data$x, c(-1, 0, 1))
  expect_identical(data$zlim, c(1L, 9L))
  expect_identical(data$target, 6.5)
  expect_identical(data$key$ends, c("1", "9"))
  expect_null(landscape_plot_data(landscape_of(1:9, target = 20))$target)
})

test_that("any landscape plots, returns itself and leaves par and R's generator alone", {
  local_device()
  set.seed(1)
  landscapes <- list(
    landscape_of(1:9), landscape_of(-(1:25), target = -10),
    landscape_of(rep(200, 9), target = 195), landscape_of(c(1:4, rep(NA, 5)))
  )
  for (landscape in landscapes) {
    expect_leaves_session_alone(expect_identical(expect_invisible(plot(landscape)), landscape))
  }
  expect_error(plot(landscape_of(rep(NA_real_, 9))), "nothing to plot",
               class = "gym_error_argument")
})

test_that("a search plays and shows its landscape, which it returns", {
  local_device()
  search <- search_random(fake_environment(reward = first_action), rounds = 2, seed = 1)
  landscape <- plot(search, type = "landscape", size = 3, episodes = 2, seed = 1, main = "mine")
  again <- search_landscape(search, size = 3, episodes = 2, seed = 1)
  expect_identical(landscape$grid, again$grid)
})

test_that("ggplot2 draws the same field", {
  skip_if_not_installed("ggplot2")
  local_device()
  plot <- ggplot2::autoplot(landscape_of(1:9, target = 6.5))
  expect_identical(plot$data$mean_return, 1:9)
  expect_silent(print(plot))
  expect_silent(print(ggplot2::autoplot(landscape_of(rep(200, 9)))))
})
