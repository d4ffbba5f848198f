walk_class <- R6::R6Class(
  "Walk",
  inherit = GymEnv,
  public = list(
    observation_space = space_discrete(5),
    action_space = space_discrete(2),
    position = NULL,
    reset = function() {
      self$position <- sample(3, 1) - 1
      self$position
    },
    step = function(action) {
      self$position <- self$position + action
      list(observation = self$position, reward = 1, terminated = self$position == 4)
    }
  )
)

test_that("a class that inherits from GymEnv is played and checked as an environment", {
  env <- walk_class$new(max_episode_steps = 8)
  expect_identical(class(env), c("Walk", "gym_r_env", "gym_env", "R6"))
  expect_identical(env$spec$id, "Walk")
  expect_error(env$step(1), "Walk has not been reset", class = "gym_error_argument")
  first <- env$reset(seed = 3)
  expect_type(first, "integer")
  expect_identical(walk_class$new()$reset(seed = 3), first)
  expect_error(env$step(2), class = "gym_error_space")
  expect_named(env$step(1), c("observation", "reward", "done", "info", "terminated", "truncated"))
  expect_equal(env$position, first + 1)
  played <- rollout(env, policy_random(), 20, seed = 1)
  expect_true(all(played$episodes$length <= 8))
  again <- rollout(walk_class$new(max_episode_steps = 8), policy_random(), 20, seed = 1)
  expect_identical(again$episodes, played$episodes)
})

test_that("an object is played itself, and is left in its last episode", {
  env <- walk_class$new()
  rollout(env, function(observation) rep(1, length(observation)), 1, seed = 1)
  expect_identical(env$position, 4)
  expect_warning(try(env$step(0), silent = TRUE), class = "gym_warning_step_after_done")
})

test_that("a class of a class works, also through super", {
  fast_class <- R6::R6Class(
    "Fast", inherit = walk_class,
    public = list(
      step = function(action) {
        out <- super$step(action)
        out$reward <- 10
        out
      }
    )
  )
  env <- fast_class$new()
  env$reset()
  expect_identical(env$step(1)$reward, 10)
})

test_that("a reset of the class may take seed and options", {
  given <- NULL
  options_class <- R6::R6Class(
    "Options", inherit = walk_class,
    public = list(reset = function(seed = NULL, options = NULL) {
      given <<- list(seed = seed, options = options)
      0
    })
  )
  env <- options_class$new()
  env$reset(seed = 4, options = list(a = 1))
  expect_identical(given, list(seed = 4, options = list(a = 1)))
  expect_error(walk_class$new()$reset(options = list(a = 1)), "does not accept options",
               class = "gym_error_argument")
})

test_that("a class that lacks something says so when it is made", {
  refused <- function(class, words) {
    expect_error(class$new(), words, fixed = TRUE, class = "gym_error_argument")
  }
  refused(R6::R6Class("Half", inherit = GymEnv, public = list(reset = function() 0)),
          "The class Half has no method `step()`")
  refused(R6::R6Class("Half", inherit = GymEnv, public = list(step = function(action) 0)),
          "The class Half has no method `reset()`")
  refused(GymEnv, "GymEnv is a class to inherit from")
  no_space_class <- R6::R6Class("NoSpace", inherit = walk_class, public = list(action_space = NULL))
  refused(no_space_class, "`action_space` must be a space, not NULL")
  unready_class <- R6::R6Class(
    "Unready", inherit = walk_class, public = list(initialize = function() NULL)
  )
  expect_error(rollout(unready_class$new(), policy_random()), "must call `super$initialize()`",
               fixed = TRUE, class = "gym_error_argument")
})

test_that("an object cannot be cloned", {
  expect_error(walk_class$new()$clone(), "Walk cannot be cloned", class = "gym_error_argument")
})
