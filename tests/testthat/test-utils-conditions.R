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

test_that("an error about an argument fills its templates where it stands", {
  f <- function(x) {
    place <- "{here}"
    abort_wrong(
      "x", x, rlang::current_env(), "`x` of {place} has
       {count_of(x, 'row')}.",
      i = "{NULL}", i = if (x > 5) "Too many.", x = "{{}} stay."
    )
  }
  cnd <- expect_error(f(2), class = "gym_error_argument")
  lines <- strsplit(cli::ansi_strip(conditionMessage(cnd)), "\n")[[1L]]
  expect_identical(lines[[1L]], "`x` of {here} has 2 rows.")
  expect_match(lines[-1L], "^[^ ]+ [{][}] stay[.]$")
  expect_identical(cnd[c("argument", "value")], list(argument = "x", value = 2))
  expect_identical(cnd$call, quote(f(2)))
})
