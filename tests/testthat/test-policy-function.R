follow_pole <- function(observation) as.integer(observation[, 3] > 0)

test_that("a function is asked about a matrix, also when there is one observation", {
  expect_identical(act(follow_pole, c(0, 0, 0.1, 0)), 1L)
  expect_identical(act(follow_pole, rbind(c(0, 0, 0.1, 0), c(0, 0, -0.1, 0))), 1:0)
  expect_identical(act(function(observation) dim(observation), matrix(0, 2, 3)), 2:3)
  expect_identical(act(function(observation) 2 * observation, c(1, 2, 3)), c(2, 4, 6))
  into_array <- function(observation) array(observation, c(1, 2, 2))
  expect_identical(act(into_array, c(1, 2, 3, 4)), matrix(c(1, 2, 3, 4), 2))
  expect_error(act(function(observation) c(1, 2), c(1, 2, 3)),
               "one action for the one observation, not 2 actions", class = "gym_error_argument")
})

test_that("a rollout asks for all lanes that play at once", {
  rows <- integer()
  count <- function(observation) {
    rows <<- c(rows, nrow(observation))
    follow_pole(observation)
  }
  lengths <- function(seed, step, action) step == 1L + seed %% 3L
  played <- rollout(fake_lanes(5, ends = lengths), count, episodes = 5, seed = 1)
  expect_identical(rows, vapply(seq_len(max(played$episodes$length)), function(step) {
    sum(played$episodes$length >= step)
  }, 0L))
  rows <- integer()
  rollout(fake_environment(), count, episodes = 2)
  expect_identical(rows, rep(1L, 6))
})

test_that("actions of one number may be a vector, a column or logical", {
  discrete <- list(
    function(observation) observation[, 3] > 0,
    function(observation) observation[, 3, drop = FALSE] > 0,
    function(observation) as.numeric(observation[, 3] > 0)
  )
  play <- function(policy, ...) {
    rollout(fake_lanes(3, ...), policy, episodes = 5, seed = 1, steps = TRUE)$steps
  }
  wanted <- play(follow_pole)
  for (policy in discrete) {
    expect_equal(play(policy), wanted)
    expect_identical(play(policy)$episode, wanted$episode)
  }
  torque <- function(observation) observation[, 1]
  column <- function(observation) observation[, 1, drop = FALSE]
  box <- box_space(-1, 1)
  expect_identical(play(torque, action_space = box), play(column, action_space = box))
  steps <- rollout(fake_environment(action_space = box), torque, steps = TRUE)$steps
  expect_identical(steps$action, steps$obs_1)
})

test_that("one action for many observations is refused, saying what came and how to write it", {
  for_one <- function(observation) as.integer(observation[3] > 0)
  cnd <- expect_error(rollout(fake_lanes(5), for_one, 5), class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "for each of 5 observations, not 1 action.", fixed = TRUE)
  expect_match(conditionMessage(cnd), "`observation[, 3]`", fixed = TRUE)
  expect_identical(as.character(cnd$call[[1]]), "rollout")
})

test_that("an action with several numbers is a row", {
  env <- fake_environment(action_space = box_space(c(-1, 9), c(1, 10)))
  cnd <- expect_error(rollout(env, function(observation) c(0.5, 9.5)),
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "for the one observation, not c(0.5, 9.5)", fixed = TRUE)
  expect_match(conditionMessage(cnd), "An action of <Box float32 [2]> is a row", fixed = TRUE)
})

test_that("observations and actions with parts have them batched, in any order of names", {
  space <- new_space(describe_dict(
    a = describe_box(c(-1, -1), c(1, 1)), b = list(name = "Discrete", n = 3L, dtype = "int64")
  ))
  lanes <- list(action_space = space, observation_space = space)
  actions <- list(b = c(1, 2), a = rbind(1:2, 3:4))
  expect_identical(lane_actions(actions, 2L, lanes), list(a = rbind(1:2, 3:4), b = c(1, 2)))
  expect_error(lane_actions(actions["a"], 2L, lanes),
               "each of 2 observations, not a list of length 1", class = "gym_error_argument")
  expect_error(lane_actions(actions, 3L, lanes), "each of 3 observations, not 2 actions",
               class = "gym_error_argument")
})

test_that("policies of other classes are asked by their own method, in lanes too", {
  registerS3method("act", "follower", function(policy, observation, ...) follow_pole(observation),
                   envir = asNamespace("gym"))
  follower <- structure(list(), class = c("follower", "gym_policy"))
  steps <- rollout(fake_lanes(3), follower, episodes = 5, steps = TRUE)$steps
  expect_identical(steps$action, as.integer(steps$obs_3 > 0))
})
