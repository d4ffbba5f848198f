autoplot <- ggplot2::autoplot

test_that("Gymnasium's grids have their rows, columns, arrows and ends", {
  client <- test_client()
  solved <- solve_mdp(env_model("FrozenLake-v1", client = client))
  data <- solution_plot_data(solved, NULL, NULL, 2, 0, 1)
  expect_identical(c(data$columns, data$rows), c(4L, 4))
  # The holes and the goal of the map SFFF FHFH FFFH HFFG.
  expect_identical(data$cells$state[data$cells$end == "pit"], c(5L, 7L, 11L, 12L))
  expect_identical(data$cells$state[data$cells$end == "goal"], 15L)
  expect_identical(data$cells$does[c(1, 15)], c("left", "down"))
  cliff <- solve_mdp(env_model("CliffWalking-v1", client = client))
  data <- solution_plot_data(cliff, NULL, NULL, 2, 0, 1)
  expect_identical(data$columns, 12L)
  expect_identical(data$cells$state[data$cells$end != ""], 47L)
  # No episode is ever on the cliff, where the grid is empty.
  picture <- drawn(autoplot(cliff))
  each <- lapply(layers_of(picture, "GeomTile"), function(layer) layer[c("x", "y")])
  tiles <- do.call(rbind, each)
  expect_identical(nrow(tiles), 38L)
  expect_false(any(tiles$y == -4 & tiles$x %in% 2:11))
  expect_identical(key_of(picture), "goal")
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
  # In the rain the taxi may go to one side instead.
  rainy <- solve_mdp(env_model("Taxi-v4", is_rainy = TRUE, client = test_client()))
  expect_identical(solution_plot_data(rainy, NULL, NULL, 4, 0, 1)$walls, data$walls)
  expect_length(layers_of(drawn(autoplot(taxi)), "GeomLabel")[[1]]$label, 4)
  expect_error(plot(taxi, passenger = 5), class = "gym_error_argument")
})

test_that("cells have the values as colours and numbers, what is done as arrows, and ends a mark", {
  solved <- solve_mdp(walk_model())
  picture <- drawn(autoplot(solved, columns = 4, directions = c("left", "right")))
  data <- solution_plot_data(solved, 4, c("left", "right"), 2, 0, 1)
  inside <- data$cells[!is.na(data$cells$value), ]
  numbers <- do.call(rbind, layers_of(picture, "GeomText"))
  expect_setequal(as.numeric(numbers$label), round(inside$value, 2))
  arrows <- do.call(rbind, layers_of(picture, "GeomSegment"))
  expect_identical(arrows$xend > arrows$x, inside$does == "right")
  expect_identical(key_of(picture), c("goal", "pit"))
  # The two ends are three columns apart, and no wider than the other cells.
  tiles <- do.call(rbind, lapply(layers_of(picture, "GeomTile"), function(layer) {
    layer[c("xmin", "xmax", "ymin", "ymax")]
  }))
  expect_equal(unique(c(tiles$xmax - tiles$xmin, tiles$ymax - tiles$ymin)), 1)
})

test_that("Q-values are triangles at the side to which an action leads, the best in bold", {
  solved <- solve_mdp(walk_model())
  picture <- drawn(autoplot(solved, type = "q", columns = 4, directions = c("left", "right")))
  triangles <- layers_of(picture, "GeomPolygon")[[1]]
  numbers <- do.call(rbind, layers_of(picture, "GeomText"))
  reached <- which(!is.na(solution_plot_data(solved, 4, NULL, 2, 0, 1)$cells$value))
  expect_length(unique(triangles$group), 2 * length(reached))
  expect_setequal(round(as.numeric(numbers$label), 2), round(as.vector(solved$q[reached, ]), 2))
  best <- numbers[numbers$fontface == "bold", ]
  expect_equal(sort(unique(as.numeric(best$label))),
               sort(unique(round(apply(solved$q[reached, ], 1, max), 2))))
  # Where one action is best, to the right of the middle of its cell.
  expect_gt(best$x[round(best$x) == 2], 2)
  rows <- drawn(autoplot(solved, type = "q"))
  expect_identical(unique(layers_of(rows, "GeomTile")[[1]]$y), c(0, 1))
})

test_that("an end that costs is a pit, alone it is one where going on gives more", {
  ends <- function(left, right, move = 0) {
    model <- gym_model(data.frame(
      state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
      reward = c(left, move, move, right)
    ), start = 1)
    end_kinds(model)
  }
  expect_identical(ends(0, 1), c("pit", "", "", "goal"))
  expect_identical(ends(-1, -1, move = -1), c("goal", "", "", "goal"))
  expect_identical(ends(-9, -9, move = 1), c("pit", "", "", "pit"))
})

test_that("without a grid the actions have a panel, and a row each", {
  # The gambler of Sutton and Barto (2018), example 4.3: stakes of up to half of the goal.
  states <- data.frame(state = rep(1:39, pmin(1:39, 39:1)))
  states$action <- sequence(pmin(1:39, 39:1))
  bets <- rbind(
    transform(states, next_state = state + action, probability = 0.4),
    transform(states, next_state = state - action, probability = 0.6)
  )
  bets$reward <- as.numeric(bets$next_state == 40)
  bets$terminated <- bets$next_state %in% c(0, 40)
  solved <- solve_mdp(gym_model(bets, start = 1, id = "Gambler"))
  picture <- drawn(autoplot(solved))
  panels <- ggplot2::ggplot_build(picture)$layout$layout$panel
  expect_identical(as.character(panels), c("value", "action"))
  taken <- layers_of(picture, "GeomPoint")
  taken <- do.call(rbind, lapply(taken, function(layer) layer[c("x", "y", "PANEL")]))
  taken <- taken[taken$PANEL == 2, ]
  expect_identical(taken$y[order(taken$x)], as.numeric(solved$actions[2:40]))
  q <- drawn(autoplot(solved, type = "q"))
  expect_gt(nrow(unique(layers_of(q, "GeomTile")[[1]]["y"])), 15)
  best <- layers_of(q, "GeomPoint")[[1]]
  expect_true(all(paste(1:39, solved$actions[2:40]) %in% paste(best$x, best$y)))
  # Actions are whole numbers, and so are their marks.
  walk <- data.frame(
    state = rep(1:40, each = 2), action = 0:1, next_state = as.vector(rbind(0:39, 2:41)),
    reward = rep(c(0, 1), c(79, 1))
  )
  walk <- solve_mdp(gym_model(walk, start = 3, id = "Walk"))
  marks <- ggplot2::ggplot_build(drawn(autoplot(walk)))$layout$panel_params[[2]]$y$breaks
  expect_equal(marks[!is.na(marks)], 0:1)
  expect_identical(action_panel(list(numbers = 0:1, directions = c("stay", "go"))),
                   "action (0 stay, 1 go)")
})

test_that("a bandit, which has one state, has all its actions in their panel", {
  bandit <- data.frame(state = 0, action = 0:2, next_state = 1, reward = c(1, 0, 5))
  solved <- solve_mdp(gym_model(transform(bandit, probability = 1, terminated = TRUE), start = 0))
  panels <- ggplot2::ggplot_build(drawn(autoplot(solved)))$layout$panel_params
  expect_gt(panels[[1]]$y.range[[1]], 2)
  expect_lt(panels[[2]]$y.range[[1]], 0)
})

test_that("any solution is drawn, and a wrong grid, direction or step refused", {
  limited <- solve_mdp(walk_model(), horizon = 3)
  expect_match(drawn(autoplot(limited))$labels$subtitle, "best values of states within 3 steps")
  drawn(autoplot(solve_mdp(walk_model(), policy = policy_random()), columns = 2))
  expect_error(plot(limited, columns = 3), "make whole rows", class = "gym_error_argument")
  expect_error(plot(limited, directions = "up"), class = "gym_error_argument")
  expect_error(plot(limited, step = 4), class = "gym_error_argument")
  expect_error(plot(limited, type = "actions"), class = "gym_error_argument")
})

test_that("numbers in cells have three digits, the same decimals, and none where they are small", {
  expect_identical(number_texts(c(1, 0.123, -0.001, NA)), c("1.00", "0.12", "0.00", ""))
  expect_identical(number_texts(c(-13.2, 7)), c("-13", "7"))
  expect_identical(text_size(list(columns = 40, rows = 40), "0.12"), 0)
  expect_gt(text_size(list(columns = 4, rows = 4), "0.12"), 3)
})
