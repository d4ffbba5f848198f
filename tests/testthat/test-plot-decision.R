map_of <- function(policy = policy_network(c(2, 1)), env = NULL, ..., xlim = c(-2, 2),
                   ylim = c(-1, 1)) {
  decision_map(env, policy, ..., x = 1, y = 2, xlim = xlim, ylim = ylim, size = 21)
}

test_that("the picture's field has a row for each x and a column for each y", {
  rising <- policy_network(c(2, 1), weights = list(matrix(c(1, 0), 1)))
  data <- decision_plot_data(map_of(rising))
  expect_identical(dim(data$z), c(21L, 21L))
  expect_equal(data$z[, 3], stats::plogis(data$x))
  expect_identical(data$x, seq(-2, 2, length.out = 21))
  expect_identical(data$border, 0.5)
  expect_equal(data$zlim, 0.5 + c(-1, 1) * (stats::plogis(2) - 0.5))
})

test_that("regions have the names of their actions, inside of them", {
  rising <- policy_network(c(2, 1), weights = list(matrix(c(1, 0), 1)))
  regions <- decision_plot_data(map_of(rising))$regions
  expect_identical(regions$label, c("0", "1"))
  expect_lt(regions$x[1], -0.5)
  expect_gt(regions$x[2], 0.5)
  always <- policy_network(c(2, 1), weights = list(matrix(0, 1, 2)))
  expect_identical(decision_plot_data(map_of(always))$regions$label, "0")
})

test_that("any map plots, returns itself and leaves par and R's generator alone", {
  local_device()
  set.seed(1)
  box <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)),
                          action_space = box_space(-2, 2))
  three <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)),
                            action_space = discrete_space(3L))
  many <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)),
                           action_space = discrete_space(18L))
  path <- data.frame(obs_1 = c(0, 0.5, 1), obs_2 = c(0, 1, 0.5))
  maps <- list(
    map_of(), map_of(path = path), map_of(path = path[1, ]),
    map_of(policy_network(c(2, 1), weights = list(matrix(0, 1, 2)))),
    map_of(policy_network(c(2, 1), c("tanh", "tanh")), box),
    map_of(policy_network(c(2, 1), c("tanh", "tanh"), list(matrix(0, 1, 2))), box),
    map_of(policy_network(c(2, 3)), three), map_of(policy_network(c(2, 18)), many),
    map_of(function(observation) rep(2L, nrow(observation)), three)
  )
  for (map in maps) {
    expect_leaves_session_alone(expect_identical(expect_invisible(plot(map)), map))
  }
  graphics::par(mfrow = c(2, 3))
  expect_silent(plot(maps[[1]], main = "a long title that is wider than the plot itself is",
                     xlab = "a"))
})

test_that("ggplot2 draws the same field and path", {
  skip_if_not_installed("ggplot2")
  path <- data.frame(obs_1 = c(0, 0.5, 1), obs_2 = c(0, 1, 0.5))
  map <- map_of(path = path)
  plot <- ggplot2::autoplot(map)
  expect_identical(plot$data$z, map$grid$output)
  layers <- vapply(plot$layers, function(layer) class(layer$geom)[1], "")
  way <- ggplot2::layer_data(plot, which(layers == "GeomPath")[1])
  expect_identical(way$x, path$obs_1)
  local_device()
  expect_silent(print(plot))
  three <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)),
                            action_space = discrete_space(3L))
  expect_silent(print(ggplot2::autoplot(map_of(policy_network(c(2, 3)), three))))
})

test_that("CartPole: an episode of the real environment lies on the map of its policy", {
  client <- test_client()
  local_device()
  policy <- search_random(rounds = 3, seed = 1, client = client)$policy
  map <- decision_map("CartPole-v0", policy, x = "pole_angle", y = "pole_angular_velocity",
                      path = TRUE, seed = 1, client = client)
  plot(map)
  played <- rollout("CartPole-v0", policy, seed = 1, steps = TRUE, client = client)
  expect_identical(map$path$x, played$steps$pole_angle)
  expect_identical(map$actions, c("0: push left", "1: push right"))
})
