autoplot <- ggplot2::autoplot

map_of <- function(policy = policy_network(c(2, 1)), env = NULL, ..., xlim = c(-2, 2),
                   ylim = c(-1, 1)) {
  decision_map(env, policy, ..., x = 1, y = 2, xlim = xlim, ylim = ylim, size = 21)
}

rising <- policy_network(c(2, 1), weights = list(matrix(c(1, 0), 1)))

plane <- function(actions) {
  fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)), action_space = actions)
}

test_that("the field has the outputs in their places, the border at one half", {
  map <- map_of(rising)
  picture <- drawn(autoplot(map))
  expect_equal(picture$data$shown, stats::plogis(picture$data$x))
  expect_identical(range(picture$data$y), c(-1, 1))
  expect_equal(unique(round(layers_of(picture, "GeomContour")[[1]]$x, 6)), 0)
  # The colours reach as far as the outputs do.
  limits <- ggplot2::ggplot_build(picture)$plot$scales$get_scales("fill")$get_limits()
  expect_equal(limits, 0.5 + c(-1, 1) * (stats::plogis(2) - 0.5))
})

test_that("the key names the actions", {
  fill <- function(map) ggplot2::ggplot_build(drawn(autoplot(map)))$plot$scales$get_scales("fill")
  expect_match(fill(map_of(rising))$name, "above 0.5:\n1", fixed = TRUE)
  two <- function(observation) ifelse(observation[, 1] < 0, 0L, 2L)
  expect_identical(fill(map_of(two, plane(discrete_space(3L))))$limits, c("0", "2"))
})

test_that("maps of actions that are numbers or many are drawn, and so are paths", {
  box <- plane(box_space(-2, 2))
  drawn(autoplot(map_of(policy_network(c(2, 1), c("tanh", "tanh")), box)))
  flat <- policy_network(c(2, 1), c("tanh", "tanh"), list(matrix(0, 1, 2)))
  drawn(autoplot(map_of(flat, box)))
  drawn(autoplot(map_of(policy_network(c(2, 18)), plane(discrete_space(18L)))))
  path <- data.frame(obs_1 = c(0, 0.5, 1), obs_2 = c(0, 1, 0.5))
  picture <- drawn(autoplot(map_of(path = path)))
  expect_identical(layers_of(picture, "GeomPath")[[1]]$x, path$obs_1)
  ends <- layers_of(picture, "GeomPoint")
  expect_identical(c(ends[[1]]$x, ends[[2]]$x), c(0, 1))
  drawn(autoplot(map_of(path = path[1, ])))
})

test_that("CartPole: an episode of the real environment lies on the map of its policy", {
  client <- test_client()
  policy <- search_random(rounds = 3, seed = 1, client = client)$policy
  map <- decision_map("CartPole-v0", policy, x = "pole_angle", y = "pole_angular_velocity",
                      path = TRUE, seed = 1, client = client)
  drawn(autoplot(map))
  played <- rollout("CartPole-v0", policy, seed = 1, steps = TRUE, client = client)
  expect_identical(map$path$x, played$steps$pole_angle)
  expect_identical(map$actions, c("0: push left", "1: push right"))
})

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

test_that("it is drawn on the known grids and on given ones, and otherwise as points", {
  map <- decision_map(lake_like(), policy_table(diag(4)[rep(1:4, 4), ]))
  picture <- drawn(autoplot(map))
  tiles <- layers_of(picture, "GeomTile")[[1]]
  expect_identical(nrow(unique(tiles[c("x", "y")])), 16L)
  expect_length(unique(tiles$fill), 4)
  arrows <- layers_of(picture, "GeomSegment")[[1]][1:4, ]
  expect_identical(sign(arrows$xend - arrows$x), c(-1, 0, 1, 0))
  expect_identical(sign(arrows$yend - arrows$y), c(0, -1, 0, 1))
  expect_identical(key_of(picture, "fill"), c("0: left", "1: down", "2: right", "3: up"))
  expect_identical(range(layers_of(autoplot(map, columns = 8), "GeomTile")[[1]]$x), c(1, 8))
  own <- decision_map(lake_like(2L, "Own-v0"), function(state) state %% 2L)
  expect_identical(nrow(layers_of(drawn(autoplot(own)), "GeomPoint")[[1]]), 16L)
  letters <- drawn(autoplot(own, columns = 4, directions = c("left", "W")))
  expect_identical(unique(layers_of(letters, "GeomText")[[1]]$label), "W")
  expect_error(plot(own, columns = 3), "make whole rows", class = "gym_error_argument")
})

test_that("states that are never visited, end an episode or cannot be are empty", {
  client <- test_client()
  map <- decision_map("FrozenLake-v1", function(state) state %% 4L, client = client)
  # The holes and the goal of the map SFFF FHFH FFFH HFFG.
  expect_identical(map$grid$state[is.na(map$grid$action)], c(5L, 7L, 11L, 12L, 15L))
  expect_output(print(map), "11 of 16 states")
  picture <- drawn(autoplot(map))
  expect_identical(nrow(layers_of(picture, "GeomTile")[[1]]), 11L)
  expect_identical(nrow(do.call(rbind, layers_of(picture, "GeomSegment"))), 11L)
  learned <- matrix(0, 16, 4)
  learned[cbind(1:3, 1:3)] <- c(1, 1, -Inf)
  map <- decision_map(lake_like(), policy_table(learned))
  expect_identical(map$grid$action, c(0:1, rep(NA, 14)))
  # The function is not asked about a state that no episode reaches.
  taxi <- decision_map("Taxi-v4", function(state) {
    stopifnot(state %/% 4 %% 5 != state %% 4)
    state %% 4L
  }, client = client)
  expect_identical(sum(is.na(taxi$grid$action)), 100L)
})

test_that("many actions are a scale, on a grid and without one", {
  env <- lake_like(50L, "Own-v0")
  map <- decision_map(env, function(state) 3L * state)
  scale_of <- function(picture, which) {
    ggplot2::ggplot_build(drawn(picture))$plot$scales$get_scales(which)
  }
  expect_identical(scale_of(autoplot(map, columns = 4), "fill")$get_limits(), c(0L, 49L))
  expect_identical(layers_of(drawn(autoplot(map)), "GeomPoint")[[1]]$y, 3 * (0:15))
  expect_lte(length(scale_of(autoplot(map), "y")$get_breaks()), 7)
  q <- outer(0:15, 0:49)
  points <- autoplot(decision_map(env, policy_table(q + 0.1)), type = "q")
  expect_s3_class(scale_of(points, "fill"), "ScaleContinuous")
  expect_identical(unique(layers_of(points, "GeomPoint")[[1]]$y), 49)
  expect_identical(anyDuplicated(named_colours(1:50)), 0L)
})

test_that("the values of a learned table are triangles on the grid, or rows", {
  map <- function(policy) decision_map(lake_like(2L, "Own-v0"), policy)
  q <- matrix(0, 16, 2)
  q[1, ] <- c(0.25, 0.5)
  q[6, ] <- c(0.75, -Inf)
  picture <- autoplot(map(policy_table(q)), type = "q", columns = 4,
                      directions = c("left", "right"))
  shown <- layers_of(drawn(picture), "GeomText")
  shown <- do.call(rbind, lapply(shown, function(layer) layer[c("label", "x", "y", "fontface")]))
  # Only of states that were left; what cannot be taken has no triangle.
  expect_setequal(shown$label, c("0.25", "0.50", "0.75"))
  expect_identical(shown$fontface[match(c("0.25", "0.50"), shown$label)], c("plain", "bold"))
  expect_lt(shown$x[shown$label == "0.25"], 1)
  expect_gt(shown$x[shown$label == "0.50"], 1)
  points <- drawn(autoplot(map(policy_table(q)), type = "q"))
  expect_identical(nrow(layers_of(points, "GeomTile")[[1]]), 3L)
  expect_error(
    plot(map(function(state) state %% 2L), type = "q"), "not of a function",
    class = "gym_error_argument"
  )
})

test_that("Taxi has a grid for each passenger and destination", {
  taxi <- fake_environment(observation_space = discrete_space(500L),
                           action_space = discrete_space(6L), id = "Taxi-v4")
  map <- decision_map(taxi, function(state) state %% 4L)
  data <- place_states(map$grid, map$env_id, map, NULL, NULL, 4, 3, NULL)
  expect_identical(nrow(data$cells), 25L)
  expect_true(all(data$cells$state %% 4 == 3 & data$cells$state %/% 4 %% 5 == 4))
  expect_match(drawn(autoplot(map))$labels$subtitle, "passenger at Y, destination R")
})

test_that("actions that are numbers of a range have no map of states", {
  box <- fake_environment(observation_space = discrete_space(3L), action_space = box_space(-1, 1))
  expect_error(
    decision_map(box, function(state) cbind(state)), "actions that are Discrete",
    class = "gym_error_argument"
  )
})

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
  expect_identical(layers_of(picture, "GeomText")[[1]]$label, rep(c("1", "0"), each = 6))
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
