autoplot <- ggplot2::autoplot

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
  expect_identical(searches$chance, 4 / (1 + 1 + 3 + 7 + 10))
  picture <- drawn(autoplot(searches))
  bars <- layers_of(picture, "GeomCol")[[1]]
  expect_identical(bars$y[order(bars$x)], c(2, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1))
  expected <- 5 * stats::dgeom(0:9, searches$chance)
  expect_equal(layers_of(picture, "GeomLine")[[1]]$y, expected)
  unsolved <- layers_of(picture, "GeomErrorbar")[[1]]
  expect_equal(unsolved$ymax, 5 * (1 - searches$chance)^10)
  expect_gt(unsolved$x, 11)
  expect_equal(sum(expected, unsolved$ymax), 5)
  expect_match(key_of(picture), "geometric, chance of a round 18%")
})

test_that("where all were solved the bars end with the last", {
  bars <- searches_bars(searches_of(c(1, 4, 2)), 3)
  expect_identical(bars$round, 1:4)
  expect_false(any(bars$unsolved))
  drawn(autoplot(searches_of(c(1, 2))))
})

test_that("the mark has the chance of that many rounds or fewer, and their share of the searches", {
  searches <- searches_of(c(1, 1, 3, 7, NA))
  picture <- function(mark) drawn(autoplot(searches, mark = mark))
  dark <- function(picture) {
    bars <- layers_of(picture, "GeomCol")[[1]]
    sort(bars$x[bars$fill == gym_colours[["blue"]]], decreasing = FALSE)
  }
  expect_identical(as.numeric(dark(picture(3))), c(1, 2, 3))
  expect_match(picture(3)$labels$subtitle, "5 seeds, 60% solved within 3 rounds, 45% by the curve")
  expect_match(picture(1)$labels$subtitle, "40% solved in the first round")
  expect_identical(picture(NULL)$labels$subtitle, "5 seeds")
  expect_length(dark(picture(NULL)), 0)
})

test_that("searches of which none was solved, and a bad mark, say so", {
  expect_error(plot(searches_of(c(NA, NA))), "no search was solved", class = "gym_error_argument")
  expect_error(plot(searches_of(1), mark = 0), "`mark`", class = "gym_error_argument")
})
