autoplot <- ggplot2::autoplot

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

test_that("the picture has the mean returns in their places, and the target's line", {
  picture <- drawn(autoplot(landscape_of(1:9, target = 6.5)))
  field <- layers_of(picture, "GeomRaster")[[1]]
  expect_identical(order(field$y, field$x), 1:9)
  lightness <- grDevices::convertColor(t(grDevices::col2rgb(field$fill)) / 255, "sRGB", "Lab")[, 1]
  expect_true(all(diff(lightness) > 0))
  lines <- layers_of(picture, "GeomContour")
  expect_identical(unique(lines[[2]]$level), 6.5)
  expect_identical(key_of(picture), c("best policy", "target 6.5"))
  expect_identical(key_of(autoplot(landscape_of(1:9, target = 20))), "best policy")
})

test_that("any landscape is drawn, and one that nobody played refused", {
  drawn(autoplot(landscape_of(-(1:25), target = -10)))
  drawn(autoplot(landscape_of(rep(200, 9), target = 195)))
  drawn(autoplot(landscape_of(c(1:4, rep(NA, 5)))))
  expect_error(plot(landscape_of(rep(NA_real_, 9))), "nothing to plot",
               class = "gym_error_argument")
})

test_that("a search plays and shows its landscape", {
  local_device()
  search <- search_random(fake_environment(reward = first_action), rounds = 2, seed = 1)
  picture <- plot(search, type = "landscape", size = 3, episodes = 2, seed = 1, main = "mine")
  again <- search_landscape(search, size = 3, episodes = 2, seed = 1)
  expect_identical(picture$data, again$grid)
  expect_identical(picture$labels$title, "mine")
})
