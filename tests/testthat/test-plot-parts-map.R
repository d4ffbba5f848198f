test_that("a map of several parts has a cell for each state, and a panel for each other part", {
  parts <- space_dict(a = space_discrete(3, 5), b = space_discrete(2), c = space_discrete(2))
  env <- gym_env(
    reset = function(self) list(a = 5L, b = 0L, c = 0L), step = function(self, action) NULL,
    observation_space = parts, action_space = space_discrete(2)
  )
  picture <- drawn(ggplot2::autoplot(decision_map(env, policy_table(cbind(1:12, 7)))))
  cells <- layers_of(picture, "GeomTile")[[1]]
  expect_identical(nrow(cells), 12L)
  expect_identical(nlevels(cells$PANEL), 2L)
  # States are whole numbers, and so are the marks.
  marks <- ggplot2::ggplot_build(picture)$layout$panel_params[[1]]$x$breaks
  expect_equal(marks[!is.na(marks)], 5:7)
  # The second action is the better one in the first six states.
  expect_identical(cells$fill, rep(action_colours(2)[2:1], each = 6))
})
