compared_scores <- function() {
  curves <- data.frame(training = rep(c("p", "q"), each = 5), seed = 1:5, steps = 50,
                       env_id = "A", mean_return = c(1:5, 2:6))
  compare_trainings(curves, seed = 1)
}

test_that("scores are bars with intervals, a panel for each statistic", {
  compared <- compared_scores()
  bars <- layers_of(drawn(ggplot2::autoplot(compared)), "GeomPointrange")[[1]]
  expect_setequal(bars$x, compared$table$value)
  expect_setequal(bars$xmin, compared$table$lower)
  expect_identical(nlevels(bars$PANEL), 2L)
  pair <- layers_of(drawn(ggplot2::autoplot(compared, "improvement")), "GeomPointrange")[[1]]
  expect_identical(pair$x, compared$improvement$probability)
})

test_that("a profile is a step line for each training", {
  picture <- drawn(ggplot2::autoplot(compared_scores(), type = "profile"))
  expect_identical(key_of(picture), c("p", "q"))
  expect_setequal(layers_of(picture, "GeomStep")[[1]]$y, (0:5) / 5)
  expect_error(plot(compared_scores(), type = "other"), class = "gym_error_argument")
})

test_that("the share that has reached a target rises in steps, with failures as ticks", {
  compared <- structure(
    c(
      list(by = "steps", notes = "targets differ: a 1; b 2", level = 0.95, runs = data.frame(
        training = "a", env_id = "A", seed = 1:3, steps = c(10, 20, 30),
        reached = c(TRUE, TRUE, FALSE)
      )),
      list(profile = data.frame(
        training = "a", env_id = "A", steps = c(0, 10, 20, 30), share = c(0, 1, 2, 2) / 3,
        lower = NA_real_, upper = NA_real_
      ))
    ),
    class = "gym_comparison"
  )
  picture <- drawn(ggplot2::autoplot(compared))
  line <- layers_of(picture, "GeomPath")[[1]]
  expect_identical(line$x, c(0, 10, 10, 20, 20, 30, 30))
  expect_equal(line$y, c(0, 0, 1, 1, 2, 2, 2) / 3)
  expect_identical(layers_of(picture, "GeomPoint")[[1]]$x, 30)
  expect_match(picture$labels$caption, "targets differ")
})
