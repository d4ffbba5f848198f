drawable <- function() {
  numbers <- fake_environment(
    observation_space = box_space(rep(-1, 3), rep(1, 3)),
    action_space = box_space(c(-1, -1), c(1, 1))
  )
  one_step <- fake_environment(ends = function(seed, step, action) TRUE)
  endless <- fake_environment(observation_space = box_space(-1, 1, 1L))
  played <- lapply(list(fake_environment(), numbers, one_step, endless), rollout,
                   policy_random(), seed = 1, steps = TRUE)
  odd <- played[[1]]
  odd$steps$obs_1 <- c(NaN, Inf, -Inf)[seq_len(nrow(odd$steps))]
  odd$steps$obs_2[1] <- NA
  c(played, list(odd))
}

test_that("any trajectory plots, returns itself and leaves par and R's generator alone", {
  for (size in list(c(7, 5), c(4, 3))) {
    local_device(size[1], size[2])
    set.seed(1)
    for (played in drawable()) {
      expect_leaves_session_alone({
        expect_silent(plot(played, type = "trajectory"))
        expect_identical(expect_invisible(plot(played, type = "trajectory", main = "mine")), played)
      })
    }
  }
})

test_that("par is put back after an error, too", {
  local_device(0.4, 0.4)
  before <- plot_parameters()
  expect_error(plot(drawable()[[1]], type = "trajectory"))
  expect_identical(plot_parameters(), before)
})

test_that("CartPole plots with all of its labels", {
  local_device(4, 3)
  expect_silent(plot(short_rollout(), type = "trajectory"))
})

test_that("panels have their places, the last one a row of its own where one is free", {
  expect_equal(arrange_panels(1), matrix(1L))
  expect_equal(arrange_panels(2), matrix(1:2))
  expect_equal(arrange_panels(4), matrix(c(1L, 3L, 2L, 4L), 2))
  expect_equal(arrange_panels(5), matrix(c(1, 3, 5, 2, 4, 5), 3))
})

test_that("a panel of a constant has a mark at its value alone, whole numbers have whole marks", {
  expect_identical(panel_scale(c(0, 0, 0), "stairs"), list(ylim = c(-0.5, 0.5), ticks = 0))
  expect_identical(panel_scale(0.25, "line")$ticks, 0.25)
  expect_identical(panel_scale(c(0, 1, 0), "stairs"), list(ylim = c(0, 1), ticks = 0:1))
  expect_null(panel_scale(c(0, 0.1), "line")$ticks)
})
