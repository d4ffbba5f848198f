test_that("a map of several parts has a cell for each state, and a panel for each other part", {
  parts <- space_dict(a = space_discrete(3, 5), b = space_discrete(2), c = space_discrete(2))
  env <- gym_env(
    reset = function(self) list(a = 5L, b = 0L, c = 0L), step = function(self, action) NULL,
    observation_space = parts, action_space = space_discrete(2)
  )
  picture <- drawn(ggplot2::autoplot(decision_map(env, policy_table(cbind(1:12, 6.5)))))
  cells <- layers_of(picture, "GeomTile")[[1]]
  expect_identical(nrow(cells), 12L)
  expect_identical(nlevels(cells$PANEL), 2L)
  # States are whole numbers, and so are the marks.
  marks <- ggplot2::ggplot_build(picture)$layout$panel_params[[1]]$x$breaks
  expect_equal(marks[!is.na(marks)], 5:7)
  # The second action is the better one in the first six states.
  expect_identical(cells$fill, rep(action_colours(2)[2:1], each = 6))
  # Colours alone do not say it.
  expect_identical(layers_of(picture, "GeomText")[[1]]$label, rep(1:0, each = 6))
})

test_that("a state that was never visited is empty, and a part with one value has no panel", {
  env <- gym_env(
    reset = function(self) c(0L, 0L, 0L), step = function(self, action) NULL,
    observation_space = space_multi_discrete(c(3, 4, 2)), action_space = space_discrete(30)
  )
  q <- matrix(0, 24, 30)
  q[cbind(1:20, 1:20)] <- 1
  q[3, ] <- -Inf
  map <- decision_map(env, policy_table(q))
  expect_identical(which(is.na(map$grid$action)), c(3L, 21:24))
  expect_output(print(map), "19 of 24 states")
  picture <- drawn(ggplot2::autoplot(map))
  expect_identical(nrow(layers_of(picture, "GeomTile")[[1]]), 19L)
  # Thirty actions are a scale.
  fill <- ggplot2::ggplot_build(picture)$plot$scales$get_scales("fill")
  expect_identical(fill$get_limits(), c(0L, 29L))
  map$grid <- map$grid[map$grid[[3]] == 0, ]
  expect_identical(nlevels(layers_of(ggplot2::autoplot(map), "GeomTile")[[1]]$PANEL), 1L)
})
