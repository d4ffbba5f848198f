lake_like <- function(actions = 4L, id = "FrozenLake-v1") {
  fake_environment(observation_space = discrete_space(16L), action_space = discrete_space(actions),
                   id = id)
}

test_that("of Discrete observations the map has the action in each state", {
  q <- diag(4)[rep(1:4, 4), ]
  map <- decision_map(lake_like(), policy_table(q))
  expect_identical(map$kind, "state")
  expect_identical(as.data.frame(map), data.frame(state = 0:15, action = rep(0:3, 4)))
  expect_output(print(map), "Decision map in FrozenLake-v1: the action in 16 states", fixed = TRUE)
  # Any policy that observes a state: a function, or a network with an input for each.
  by_function <- decision_map(lake_like(), function(state) state %% 4L)
  expect_identical(by_function$grid, map$grid)
  network <- decision_map(lake_like(), policy_network(c(16, 4), "identity", weights = list(t(q))))
  expect_identical(network$grid, map$grid)
})

test_that("it plots on the known grids and on given ones, and otherwise as points", {
  local_device()
  map <- decision_map(lake_like(), policy_table(diag(4)[rep(1:4, 4), ]))
  data <- state_map_data(map, NULL, NULL, 2, 0)
  expect_identical(c(data$columns, data$rows), c(4L, 4))
  expect_identical(data$cells$does[1:4], c("left", "down", "right", "up"))
  expect_length(unique(data$fill), 4)
  expect_leaves_session_alone(expect_identical(plot(map), map))
  plot(map, columns = 8)
  own <- decision_map(lake_like(2L, "Own-v0"), function(state) state %% 2L)
  expect_null(state_map_data(own, NULL, NULL, 2, 0)$columns)
  plot(own)
  plot(own, columns = 4, directions = c("left", "W"))
  expect_error(plot(own, columns = 3), "make whole rows", class = "gym_error_argument")
  testthat::skip_if_not_installed("ggplot2")
  expect_identical(
    ggplot2::layer_data(ggplot2::autoplot(map), 2)$label[1:2], c("\u2190", "\u2193")
  )
  expect_s3_class(ggplot2::autoplot(own), "ggplot")
})

test_that("Taxi has a grid for each passenger and destination", {
  taxi <- fake_environment(observation_space = discrete_space(500L),
                           action_space = discrete_space(6L), id = "Taxi-v4")
  map <- decision_map(taxi, function(state) state %% 4L)
  data <- state_map_data(map, NULL, NULL, 4, 3)
  expect_identical(nrow(data$cells), 25L)
  expect_true(all(data$cells$state %% 4 == 3 & data$cells$state %/% 4 %% 5 == 4))
  local_device()
  expect_identical(plot(map), map)
})

test_that("actions that are numbers of a range have no map of states", {
  box <- fake_environment(observation_space = discrete_space(3L), action_space = box_space(-1, 1))
  expect_error(
    decision_map(box, function(state) cbind(state)), "actions that are Discrete",
    class = "gym_error_argument"
  )
})
