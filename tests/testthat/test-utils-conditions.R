test_that("a function that has ended names what replaces it", {
  cnd <- expect_error(search_repeat("CartPole-v0", seeds = 1:3), class = "gym_error_defunct")
  expect_match(conditionMessage(cnd), "`search_repeat()` has ended.", fixed = TRUE)
  expect_match(conditionMessage(cnd), "Instead, use `search_random(seeds = )`.", fixed = TRUE)
  expect_error(gym::search_landscape(), "`search_landscape()` has ended", fixed = TRUE,
               class = "gym_error_defunct")
})

test_that("steps as arrays have ended, before anything is played", {
  expect_error(rollout("CartPole-v1", policy_random(), steps = "arrays"), "`steps = TRUE`",
               class = "gym_error_defunct")
})

test_that("a class that inherits from GymEnv names what replaces it", {
  walk <- R6::R6Class("Walk", inherit = GymEnv, public = list(reset = function() 0))
  cnd <- expect_error(walk$new(), "The class GymEnv has ended", class = "gym_error_defunct")
  expect_match(conditionMessage(cnd), "functions of `self` to `gym_env()`", fixed = TRUE)
})
