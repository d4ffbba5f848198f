test_that("Gymnasium's grids have their rows, columns, arrows and ends", {
  client <- test_client()
  solved <- solve_mdp(env_model("FrozenLake-v1", client = client))
  data <- solution_plot_data(solved, NULL, NULL, 2, 0, 1)
  expect_identical(c(data$columns, data$rows), c(4L, 4))
  # The holes and the goal of the map SFFF FHFH FFFH HFFG.
  expect_identical(data$cells$state[data$cells$ends], c(5L, 7L, 11L, 12L, 15L))
  expect_identical(data$cells$does[c(1, 15)], c("left", "down"))
  cliff <- solve_mdp(env_model("CliffWalking-v1", client = client))
  data <- solution_plot_data(cliff, NULL, NULL, 2, 0, 1)
  expect_identical(data$columns, 12L)
  # No episode is ever on the cliff.
  expect_identical(which(is.na(data$cells$value)), 38:47)
  expect_identical(data$cells$state[data$cells$ends], 47L)
})

test_that("Taxi has a grid for each passenger and destination, with its walls", {
  taxi <- solve_mdp(env_model("Taxi-v4", client = test_client()))
  data <- solution_plot_data(taxi, NULL, NULL, 4, 0, 1)
  expect_identical(nrow(data$cells), 25L)
  here <- data$cells[data$cells$row == 1 & data$cells$column == 1, ]
  expect_identical(here$does, "D")
  # Gymnasium's map: +---------+ |R: | : :G| |X: | : : | | : : : : | | | : | : | |Y| : |B: |
  walls <- with(data$walls, paste(row, column))
  expect_setequal(walls, c("1 2", "2 2", "4 1", "5 1", "4 3", "5 3"))
  expect_error(plot(taxi, passenger = 5), class = "gym_error_argument")
})

test_that("any solution plots, returns itself and leaves par and R's generator alone", {
  local_device()
  limited <- solve_mdp(walk_model(), horizon = 3)
  policy <- solve_mdp(walk_model(), policy = policy_random())
  for (solved in list(solve_mdp(walk_model()), limited, policy)) {
    expect_leaves_session_alone({
      expect_identical(plot(solved), solved)
      plot(solved, columns = 2, directions = c("left", "right"), main = "Walk")
    })
  }
  expect_error(plot(limited, columns = 3), "make whole rows", class = "gym_error_argument")
  expect_error(plot(limited, directions = "up"), class = "gym_error_argument")
  expect_error(plot(limited, step = 4), class = "gym_error_argument")
})

test_that("ggplot2 draws the same cells", {
  testthat::skip_if_not_installed("ggplot2")
  solved <- solve_mdp(walk_model())
  grid <- ggplot2::autoplot(solved, columns = 4, directions = c("left", "right"))
  expect_identical(ggplot2::layer_data(grid, 2)$label, c("\u00d7", "\u2192", "\u2192", "\u00d7"))
  expect_s3_class(ggplot2::autoplot(solved), "ggplot")
})
