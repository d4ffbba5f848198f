counting <- function(b, ...) {
  gym_env(
    function(self) {
      if (is.null(self$b)) self$b <- new.env()
      self$b$n <- 0
    },
    function(self, action) {
      self$b$n <- self$b$n + 1
      list(observation = self$b$n, reward = 1, terminated = self$b$n >= 5)
    },
    space_box(0, 9, shape = 1), space_discrete(2), b = b, ...
  )
}

counter <- R6::R6Class("Counter", public = list(n = 0), cloneable = FALSE)

test_that("a value that all sub-environments would share is refused, with the way to own one", {
  refused <- function(code, words) {
    expect_error(code, words, fixed = TRUE, class = "gym_error_argument")
  }
  refused(counting(new.env()), "`b` is an environment of R, which all sub-environments")
  refused(counting(new.env()), "self$b <- new.env()`")
  refused(counting(counter$new()), "`if (is.null(self$b)) self$b <- Counter$new()`")
  refused(counting(list(1, a = list(counter$new()))), "`b$a[[1]]` is an object of class Counter")
  refused(counting(counting(NULL, id = "Five")), "self$b <- gym_make(\"Five\", seed = 1)`")
  # What nobody changes is none: a class, functions, tables, models.
  kept <- list(counter, mean, lm(dist ~ speed, cars), cars, policy_random(), NULL)
  lengths <- rollout(counting(NULL, kept = kept), policy_random(), episodes = 40, seed = 1)$episodes
  expect_identical(lengths$length, rep(5L, 40L))
})

test_that("arguments that are registered share nothing, either", {
  on.exit(try(gym_unregister("Shared-v0"), silent = TRUE))
  refused <- function(code, words) {
    expect_error(code, words, fixed = TRUE, class = "gym_error_argument")
  }
  refused(gym_register("Shared-v0", counting, b = new.env()), "`b` is an environment of R")
  gym_register("Shared-v0", counting, b = NULL)
  refused(rollout("Shared-v0", policy_random(), b = new.env()), "`b` is an environment of R")
})
