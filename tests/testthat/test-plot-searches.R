searches_of <- function(round, max_rounds = 10L) {
  searches <- Map(function(seed, round) {
    played <- if (is.na(round)) max_rounds else round
    list(
      seed = seed, solved = !is.na(round), round = round, interrupted = FALSE, elapsed = 0,
      rounds = data.frame(round = seq_len(played), mean_return = 1, steps = 1L)
    )
  }, seq_along(round), as.integer(round))
  given <- list(target = 1, template = policy_network(), max_rounds = max_rounds, episodes = 5L)
  new_searches(list(trainings = searches, env_id = "Fake-v0"), given)
}

test_that("bars count the searches, the curve is geometric with the estimated chance", {
  searches <- searches_of(c(1, 1, 3, 7, NA))
  data <- searches_plot_data(searches)
  expect_identical(searches$chance, 4 / (1 + 1 + 3 + 7 + 10))
  solved <- data$bars[!data$bars$unsolved, ]
  expect_identical(solved$round, 1:10)
  expect_identical(solved$searches, c(2L, 0L, 1L, 0L, 0L, 0L, 1L, 0L, 0L, 0L))
  expect_equal(solved$expected, 5 * stats::dgeom(0:9, searches$chance))
  unsolved <- data$bars[data$bars$unsolved, ]
  expect_identical(unsolved$searches, 1L)
  expect_equal(unsolved$expected, 5 * (1 - searches$chance)^10)
  expect_gt(unsolved$x, 11)
  expect_equal(sum(data$bars$expected), 5)
})

test_that("where all were solved the bars end with the last", {
  bars <- searches_plot_data(searches_of(c(1, 4, 2)))$bars
  expect_identical(bars$round, 1:4)
  expect_false(any(bars$unsolved))
})

test_that("the mark has the chance of that many rounds or fewer, and their share of the searches", {
  searches <- searches_of(c(1, 1, 3, 7, NA))
  data <- searches_plot_data(searches, mark = 3)
  expect_equal(data$marked$expected, 1 - (1 - searches$chance)^3)
  expect_identical(data$marked$observed, 3 / 5)
  expect_identical(which(data$bars$marked), 1:3)
  expect_match(data$mark_label[[1]], "within 3 rounds")
  expect_match(searches_plot_data(searches, mark = 1)$mark_label[[1]], "in the first round")
  none <- searches_plot_data(searches, mark = NULL)
  expect_null(none$mark_label)
  expect_false(any(none$bars$marked))
})

test_that("any searches plot, return themselves and leave par and R's generator alone", {
  local_device()
  set.seed(1)
  each <- list(searches_of(c(1, 1, 3, 7, NA)), searches_of(1), searches_of(c(300, NA), 400L))
  for (searches in each) {
    expect_leaves_session_alone(expect_identical(expect_invisible(plot(searches)), searches))
  }
  expect_silent(plot(searches, mark = NULL))
  graphics::par(mfrow = c(2, 3))
  expect_silent(plot(searches, main = "mine", xlab = "a"))
})

test_that("searches of which none was solved, and a bad mark, say so", {
  local_device()
  expect_error(plot(searches_of(c(NA, NA))), "no search was solved", class = "gym_error_argument")
  expect_error(plot(searches_of(1), mark = 0), "`mark`", class = "gym_error_argument")
})

test_that("ggplot2 draws the same bars and curve", {
  skip_if_not_installed("ggplot2")
  searches <- searches_of(c(1, 1, 3, 7, NA))
  plot <- ggplot2::autoplot(searches)
  data <- searches_plot_data(searches)
  bars <- ggplot2::layer_data(plot, 1L)
  expect_identical(bars$y[order(bars$x)], as.numeric(data$bars$searches))
  expect_equal(ggplot2::layer_data(plot, 2L)$y, data$bars$expected[!data$bars$unsolved])
  local_device()
  expect_silent(print(plot))
  expect_silent(print(ggplot2::autoplot(searches_of(c(1, 2)))))
})
