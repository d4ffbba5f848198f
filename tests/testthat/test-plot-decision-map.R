cartpole <- function(...) fake_environment(id = "CartPole-v1", ...)

pole_map <- function(policy = policy_network(), env = cartpole(), ..., size = 5) {
  decision_map(env, policy, "pole_angle", "pole_angular_velocity", ..., size = size)
}

# The observations of a map's points.
map_observations <- function(map, names) {
  points <- as.data.frame(map)
  columns <- lapply(names, function(name) {
    if (name %in% names(points)) points[[name]] else rep(map$at[[name]], nrow(points))
  })
  do.call(cbind, columns)
}

cartpole_parts <- c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity")

test_that("the output at each point is the network's, and rounds to its action", {
  set.seed(1)
  policy <- policy_bind(policy_network(), cartpole())
  map <- pole_map(policy, at = c(cart_velocity = -0.7, cart_position = 2))
  expect_identical(map$kind, "output")
  expect_identical(nrow(map$grid), 25L)
  expect_identical(map$at, c(cart_position = 2, cart_velocity = -0.7))
  observations <- map_observations(map, cartpole_parts)
  expect_identical(map$grid$output, network_outputs(policy, observations)[, 1])
  expect_identical(as.integer(map$grid$output > 0.5), act(policy, observations))
})

test_that("outputs of tanh are scaled to the range from 0 to 1", {
  policy <- policy_network(c(4, 1), c("tanh", "tanh"), list(matrix(c(0, 0, 10, 0), 1)))
  map <- pole_map(policy)
  expect_equal(map$grid$output, (tanh(10 * map$grid$pole_angle) + 1) / 2)
})

test_that("of several outputs the action with the largest is mapped", {
  env <- fake_environment(action_space = discrete_space(3L, start = 5L))
  policy <- policy_bind(policy_network(c(4, 6, 3)), env)
  map <- decision_map(env, policy, 1, 3, xlim = c(-9, 9), ylim = c(-9, 9), size = 9)
  expect_identical(map$kind, "choice")
  expect_identical(map$actions, c("5", "6", "7"))
  observations <- map_observations(map, paste0("obs_", 1:4))
  expect_identical(map$grid$action, act(policy, observations))
})

test_that("of a Box the value of the action is mapped, of several the one that is named", {
  env <- fake_environment(action_space = box_space(c(-2, 0), c(2, 10)), id = "Other-v0")
  policy <- policy_bind(policy_network(c(4, 3, 2)), env)
  map <- decision_map(env, policy, "obs_1", "obs_2", action = 2, size = 4)
  expect_identical(map$kind, "value")
  expect_identical(map$limits, c(0, 10))
  expect_identical(map$actions, "action_2")
  expect_equal(map$grid$action, act(policy, map_observations(map, paste0("obs_", 1:4)))[, 2])
  expect_error(decision_map(env, policy, 1, 2, action = 3), "`action`",
               class = "gym_error_argument")
})

test_that("a function is asked about the same points", {
  follow <- function(observation) as.integer(observation[, 3] > 0)
  map <- pole_map(follow)
  expect_identical(map$kind, "choice")
  expect_identical(map$grid$action, as.integer(map$grid$pole_angle > 0))
  image <- fake_environment(observation_space = box_space(-(1:6), 1:6, shape = c(2L, 3L)))
  seen <- NULL
  decision_map(image, function(observation) {
    seen <<- observation
    integer(nrow(observation))
  }, 2, 4, size = 3)
  expect_identical(dim(seen), c(9L, 2L, 3L))
  # Row by row: the second number is in the first row, the fourth the first of the second.
  expect_identical(unique(seen[, 1, 2]), c(-2, 0, 2))
  expect_identical(unique(seen[, 2, 1]), c(-4, 0, 4))
  expect_true(all(seen[, 1, c(1, 3)] == 0))
})

test_that("a function gets the names that observations have in play", {
  by_name <- pole_map(function(observation) as.integer(observation[, "pole_angle"] > 0))
  expect_identical(by_name$grid$action, as.integer(by_name$grid$pole_angle > 0))
  counted <- new_space(list(
    name = "MultiDiscrete", shape = list(2L), dtype = "int64", nvec = list(3L, 2L)
  ))
  counted$names <- c("sum", "ace")
  hand <- function(observation) as.integer(observation[, "sum"] == 2)
  env <- gym_env(
    reset = function(self) c(0L, 0L), step = function(self, action) NULL,
    observation_space = counted, action_space = space_discrete(2)
  )
  map <- decision_map(env, hand)
  expect_identical(map$grid$action, c(0L, 0L, 0L, 0L, 1L, 1L))
})

test_that("parts are named or numbered, and two need not be named", {
  policy <- policy_network(c(2, 1))
  env <- fake_environment(observation_space = box_space(c(-1, -2), c(1, 2)), id = "MountainCar-v0")
  map <- decision_map(env, policy)
  expect_identical(c(map$x, map$y), c("position", "velocity"))
  expect_identical(decision_map(env, policy, 2, 1)$x, "velocity")
  expect_error(pole_map(env = NULL), "`x` must be a part of the observation, not \"pole_angle\"",
               class = "gym_error_argument")
  bad <- function(..., message) {
    expect_error(decision_map(cartpole(), policy_network(), ...), message, fixed = TRUE,
                 class = "gym_error_argument")
  }
  bad(message = "`x` and `y` must name two parts")
  bad("pole_angle", message = quoted_names(cartpole_parts))
  bad("pole_angle", "angle", message = "`y` must be a part of the observation, not \"angle\"")
  bad(1, 5, message = "`y`")
  bad(1, 1, message = "two different parts")
  bad(1, 2, at = 3, message = "`at` must be a numeric vector with names")
  bad(1, 2, at = c(cart_position = 1), message = "`at` names cart_position, which is on an axis")
  bad(1, 2, at = c(nose = 1), message = "no part of the observation")
  bad(1, 2, xlim = c(1, 0), message = "`xlim`")
  bad(1, 2, size = 1, message = "`size`")
  bad(1, 2, path = 3, message = "`path` must be a rollout with steps")
  bad(1, 2, path = data.frame(a = 1), message = "`path` has no column")
})

test_that("other parts are held at 0, or in the middle where 0 is out of bounds", {
  env <- fake_environment(observation_space = box_space(c(-1, 2, -Inf, -1), c(1, 4, Inf, 1)))
  expect_identical(decision_map(env, policy_network(), 1, 4)$at, c(obs_2 = 3, obs_3 = 0))
})

test_that("ranges are given, usual, those of the path, or the bounds", {
  ends <- function(map) unname(unlist(lapply(map$grid[1:2], range)))
  expect_equal(ends(pole_map()), c(c(-1, 1) * 12 * pi / 180, -2.5, 2.5))
  expect_equal(ends(pole_map(xlim = c(0, 1))), c(0, 1, -2.5, 2.5))
  env <- fake_environment(observation_space = box_space(c(-5, -Inf, -1, -1), c(7, Inf, 1, 1)))
  path <- data.frame(obs_1 = c(1, 2), obs_2 = c(10, 30))
  expect_equal(ends(decision_map(env, policy_network(), 1, 2, path = path)), c(0.95, 2.05, 9, 31))
  # Not beyond the bounds, and those where the path does not move.
  edge <- data.frame(obs_1 = c(-5, 5), obs_3 = 0)
  expect_equal(ends(decision_map(env, policy_network(), 1, 3, path = edge)), c(-5, 5.5, -1, 1))
  expect_error(decision_map(env, policy_network(), 1, 2), "range of obs_2 is unknown",
               class = "gym_error_argument")
  beyond <- data.frame(pole_angle = c(0, 1), pole_angular_velocity = c(0, 1))
  expect_equal(ends(pole_map(path = beyond))[2], 1)
})

test_that("a path is that of the rollout's steps, episode by episode", {
  env <- cartpole()
  played <- rollout(env, policy_network(), episodes = 2, seed = 1, steps = TRUE)
  map <- pole_map(env = env, path = played)
  expect_identical(map$path$x, played$steps$pole_angle)
  expect_identical(map$path$y, played$steps$pole_angular_velocity)
  expect_identical(map$path$episode, played$steps$episode)
  expect_error(pole_map(path = rollout(env, policy_network())), "no steps in a table",
               class = "gym_error_argument")
})

test_that("path = TRUE plays one episode under the seed, and nothing else is played", {
  env <- cartpole()
  set.seed(1)
  policy <- policy_network()
  state <- .Random.seed
  map <- pole_map(policy, env, path = TRUE, seed = 3)
  expect_identical(.Random.seed, state)
  expect_length(env$seeds, 1)
  expect_identical(map$path$x, rollout(env, policy, seed = 3, steps = TRUE)$steps$pole_angle)
  quiet <- cartpole()
  pole_map(policy, quiet)
  expect_length(quiet$seeds, 0)
  bound <- policy_bind(policy, quiet)
  expect_error(pole_map(bound, env = NULL, path = TRUE), "the environment is needed",
               class = "gym_error_argument")
})

test_that("a network that was played needs no environment, one of its own no names", {
  bound <- policy_bind(policy_network(), cartpole())
  expect_identical(pole_map(bound, env = NULL), pole_map(bound))
  map <- decision_map(policy = policy_network(), x = 1, y = "obs_2", xlim = 0:1, ylim = 0:1)
  expect_identical(map$actions, c("0", "1"))
})

test_that("what cannot be mapped says why", {
  bad <- function(policy, env = NULL, ..., message) {
    expect_error(decision_map(env, policy, ...), message, fixed = TRUE,
                 class = "gym_error_argument")
  }
  bad(policy_random(), cartpole(), message = "a random policy ignores the observation")
  bad(function(observation) 1, message = "a decision map needs a network")
  bad(policy_linear(), message = "a decision map needs a network that knows its sizes")
  bad("CartPole-v1", message = "`policy` must be a policy")
  one <- fake_environment(observation_space = box_space(-1, 1),
                          action_space = box_space(-1, 1))
  bad(policy_network(c(1, 1), c("tanh", "tanh")), one, 1, 1, message = "observes only one")
  pairs <- fake_environment(observation_space = space_text(3), id = "Pairs-v0")
  bad(function(observation) 0L, pairs,
      message = "observations in Pairs-v0 are of")
  several <- fake_environment(action_space = new_space(
    list(name = "MultiBinary", shape = list(2L), dtype = "int8")
  ))
  bad(function(observation) observation, several, 1, 2,
      message = "A decision map shows actions that are discrete or a Box, not of")
})

test_that("it says what it is in a few lines", {
  expect_output(
    print(pole_map()),
    paste0("Decision map in CartPole-v1: pole_angle by pole_angular_velocity, 5 x 5 points\n",
           "Policy: network 4-2-1, tanh, logistic, 10 weights\n",
           "Held: cart_position = 0, cart_velocity = 0"),
    fixed = TRUE
  )
})

test_that("a policy in the environment's place is told where it belongs", {
  expect_error(decision_map(policy_network()), "decision_map(policy = policy)", fixed = TRUE,
               class = "gym_error_argument")
})

test_that("a network that draws is mapped by its probabilities, or its most likely action", {
  withr::local_seed(1)
  before <- .Random.seed
  softmax <- policy_network(c(2, 2), weights = list(rbind(0, c(1, -2))), output = "softmax")
  map <- decision_map(policy = softmax, xlim = c(-1, 1), ylim = c(-1, 1), size = 5)
  expect_equal(map$grid$output, plogis(map$grid[[1]] - 2 * map$grid[[2]]))
  three <- policy_network(c(2, 3), weights = list(diag(3)[, 1:2]), output = "softmax")
  map <- decision_map(policy = three, xlim = c(-1, 1), ylim = c(-1, 1), size = 5)
  expect_identical(map$grid$action, act(three, as.matrix(map$grid[1:2]), draw = FALSE))
  expect_identical(.Random.seed, before)
})

test_that("several parts with few values each have a map, of a table with its values", {
  parts <- space_dict(a = space_discrete(3, 5), b = space_discrete(2), c = space_discrete(2))
  env <- gym_env(
    reset = function(self) list(a = 5L, b = 0L, c = 0L), step = function(self, action) NULL,
    observation_space = parts, action_space = space_discrete(2)
  )
  policy <- policy_table(cbind(1:12, 7.5))
  map <- decision_map(env, policy)
  expect_identical(map[c("x", "y", "panels")], list(x = "a", y = "b", panels = "c"))
  expect_identical(map$grid$action, rep(1:0, c(7, 5)))
  expect_identical(map$grid$value, pmax(1:12, 7.5))
  asks <- decision_map(env, function(observation) as.integer(observation[[1]] == 6), "c", "a",
                       at = c(b = 1), ylim = c(6, 7))
  expect_identical(asks$panels, character())
  expect_identical(asks$grid, data.frame(
    a = c(6L, 6L, 7L, 7L), b = 1L, c = c(0L, 1L, 0L, 1L), action = c(1L, 1L, 0L, 0L)
  ))
  expect_output(print(map), "the action by a and b, for each c, 12 states", fixed = TRUE)
})
