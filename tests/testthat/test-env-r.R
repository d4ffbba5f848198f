# A walk along a corridor, by which the tests see what the functions were given.
local_walk <- function(..., step = NULL) {
  walk <- function(self, action) {
    self$position <- self$position + if (action == 1) 1 else -1
    list(
      observation = self$position, reward = -1, terminated = abs(self$position) == self$size
    )
  }
  gym_env(
    reset = function(self) {
      self$position <- 0
      self$position
    },
    step = step %||% walk,
    observation_space = space_discrete(7, start = -3), action_space = space_discrete(2),
    ..., size = 3, id = "Walk"
  )
}

# Ends after three steps, observes two numbers drawn at random.
local_dice <- function(...) {
  gym_env(
    reset = function(self) {
      self$step <- 0
      runif(2)
    },
    step = function(self, action) {
      self$step <- self$step + 1
      list(observation = runif(2), reward = rnorm(1), terminated = self$step == 3)
    },
    observation_space = space_box(c(a = 0, b = 0), c(1, 1)), action_space = space_discrete(2),
    id = "Dice", ...
  )
}

test_that("an environment of functions is played as one of gym_make()", {
  env <- local_walk(max_episode_steps = 100, reward_threshold = -4, render_fps = 5)
  expect_s3_class(env, c("gym_r_env", "gym_env", "R6"), exact = FALSE)
  expect_identical(env$reset(), 0L)
  out <- env$step(1)
  expect_identical(out, list(
    observation = 1L, reward = -1, done = FALSE, info = list(), terminated = FALSE,
    truncated = FALSE
  ))
  env$step(TRUE)
  expect_true(env$step(1L)$done)
  expect_identical(env$reset(return_info = TRUE), list(observation = 0L, info = list()))
  expect_identical(env$spec, list(
    id = "Walk", reward_threshold = -4, max_episode_steps = 100L, render_fps = 5
  ))
  expect_null(env$num_envs)
  expect_identical(env$single_action_space, env$action_space)
  expect_identical(env$observation_space, space_discrete(7, start = -3))
  expect_error(env$stpe(1), "Did you mean `$step`", fixed = TRUE, class = "gym_error_argument")
})

test_that("a closed environment, and one that was not reset, say what to do", {
  env <- local_walk()
  expect_error(env$step(1), "has not been reset", class = "gym_error_argument")
  env$reset()
  expect_true(env$is_open)
  expect_identical(env$close(), env)
  expect_false(env$is_open)
  expect_error(env$reset(), "was closed", class = "gym_error_argument")
  expect_error(env$step(1), "was closed", class = "gym_error_argument")
  expect_error(rollout(env, policy_random()), "was closed", class = "gym_error_argument")
})

test_that("a step after the end is warned of once an episode", {
  env <- local_walk()
  for (episode in 1:2) {
    env$reset()
    for (step in 1:3) env$step(1)
    expect_warning(try(env$step(0)), class = "gym_warning_step_after_done")
    expect_no_warning(env$step(0))
  }
})

test_that("options reach a reset that takes them, and are refused by one that does not", {
  env <- gym_env(
    reset = function(self, options = NULL) options$start %||% 0,
    step = function(self, action) list(observation = 0, reward = 0, terminated = TRUE),
    observation_space = space_discrete(3), action_space = space_discrete(1)
  )
  expect_identical(env$reset(), 0L)
  expect_identical(env$reset(options = list(start = 2)), 2L)
  expect_error(local_walk()$reset(options = list(start = 2)), "of Walk does not accept options",
               fixed = TRUE, class = "gym_error_argument")
  expect_error(env$reset(options = 3), "a list with names", class = "gym_error_argument")
})

test_that("info is handed on, and numbers with names have those of the space", {
  env <- gym_env(
    reset = function(self) c(1, 2),
    step = function(self, action) {
      list(observation = c(x = 3, y = 4), reward = TRUE, terminated = FALSE, info = list(k = 1))
    },
    observation_space = space_box(c(position = -9, velocity = -9), c(9, 9)),
    action_space = space_box(-1, 1, shape = 2)
  )
  expect_identical(env$reset(), c(position = 1, velocity = 2))
  out <- env$step(c(0, 5))
  expect_identical(out$observation, c(position = 3, velocity = 4))
  expect_identical(out$info, list(k = 1))
  expect_identical(out$reward, 1)
})

test_that("the parts of a Dict may come in any order", {
  env <- gym_env(
    reset = function(self) list(b = c(1, 2), a = 1),
    step = function(self, action) {
      list(observation = list(b = action$y, a = action$x), reward = 0, terminated = TRUE)
    },
    observation_space = space_dict(a = space_discrete(3), b = space_box(-9, 9, shape = 2)),
    action_space = space_dict(x = space_discrete(3), y = space_box(-9, 9, shape = 2))
  )
  expect_identical(env$reset(), list(a = 1L, b = c(1, 2)))
  expect_identical(env$step(list(y = c(3, 4), x = 2))$observation, list(a = 2L, b = c(3, 4)))
  played <- rollout(env, policy_random(), episodes = 5, seed = 1, steps = TRUE)
  expect_identical(played$steps$obs_b_2, rep(2, 5))
})

test_that("episodes are cut off at the limit, and both flags may be set", {
  env <- local_walk(max_episode_steps = 3)
  env$reset()
  for (step in 1:2) expect_false(env$step(step %% 2)$done)
  expect_identical(env$step(1)[c("terminated", "truncated")],
                   list(terminated = FALSE, truncated = TRUE))
  env$reset()
  for (step in 1:2) env$step(1)
  expect_identical(env$step(1)[c("terminated", "truncated")],
                   list(terminated = TRUE, truncated = TRUE))
})

# Random numbers ----------------------------------------------------------------------

test_that("a seed gives the same draws whatever the session's generator is", {
  draws <- function() {
    env <- local_dice()
    c(env$reset(seed = 5), unlist(lapply(1:3, function(i) env$step(0)[c("observation", "reward")])))
  }
  first <- draws()
  expect_identical(draws(), first)
  withr::local_seed(1, .rng_kind = "Wichmann-Hill", .rng_normal_kind = "Box-Muller",
                    .rng_sample_kind = "Rejection")
  expect_identical(draws(), first)
  env <- local_dice()
  expect_false(identical(unname(env$reset(seed = 6)), unname(first[1:2])))
})

test_that("the session's generator moves by one draw at the first need, and not otherwise", {
  withr::local_seed(1)
  env <- local_dice()
  before <- .Random.seed
  env$reset(seed = 3)
  env$step(0)
  env$reset()
  expect_identical(.Random.seed, before)
  other <- local_dice()
  expect_identical(.Random.seed, before)
  start <- other$reset()
  after <- .Random.seed
  set.seed(1)
  expect_identical(other$reset(seed = draw_seed()), start)
  expect_identical(.Random.seed, after)
  expect_false(identical(other$reset(), start))
  expect_identical(.Random.seed, after)
})

test_that("an episode of a rollout has the draws of its seed, step for step", {
  env <- local_dice()
  played <- rollout(env, policy_random(), 20, seed = 1, steps = TRUE)
  last <- played$steps[played$steps$episode == 19, ]
  expect_identical(env$reset(seed = played$episodes$seed[[19]])[["a"]], last$a[[1]])
  for (step in 1:2) expect_identical(env$step(0)$observation[["a"]], last$a[[step + 1]])
})

test_that("an error in a step leaves the session's generator as it was", {
  withr::local_seed(1)
  env <- local_walk(step = function(self, action) stop(runif(1)))
  env$reset(seed = 1)
  before <- .Random.seed
  expect_error(env$step(1), class = "gym_error_environment")
  expect_identical(.Random.seed, before)
})

# Bad input ---------------------------------------------------------------------------

test_that("functions, spaces and values that cannot be are refused with the fix", {
  reset <- function(self) 0
  step <- function(self, action) NULL
  make <- function(...) {
    given <- list(...)
    good <- list(reset = reset, step = step, observation_space = space_discrete(2),
                 action_space = space_discrete(2))
    good[names(given)] <- given
    do.call(gym_env, good)
  }
  refused <- function(..., words) {
    expect_error(make(...), words, fixed = TRUE, class = "gym_error_argument")
  }
  refused(reset = 3, words = "`reset` must be a function of `self`, not 3")
  refused(reset = function() 0, words = "`reset` must be a function of `self`, and this one has 0")
  refused(step = function(self) 0, words = "`step` must be a function of `self` and `action`")
  refused(render = function() 0, words = "`render` must be a function of `self`")
  refused(observation_space = 4, words = "`observation_space` must be a space, not 4")
  refused(action_space = "Discrete", words = "`space_discrete()` and others make one")
  refused(vectorized = NA, words = "`vectorized` must be TRUE or FALSE")
  refused(id = 3, words = "`id` must be a string, not 3")
  refused(max_episode_steps = 0, words = "`max_episode_steps` must be a whole number")
  refused(reward_threshold = "a", words = "`reward_threshold` must be a number")
  refused(render_fps = 0, words = "`render_fps` must be a number")
  expect_error(gym_env(reset, step, space_discrete(2), space_discrete(2), NULL, FALSE, 5),
               "Further arguments need names", class = "gym_error_argument")
  expect_error(make(vectorized = TRUE, num_envs = 0), "whole number", class = "gym_error_argument")
})

test_that("what a step returns is refused in the step that returned it", {
  skip_unless_all()
  refused <- function(out, words, class = "gym_error_argument") {
    env <- local_walk(step = function(self, action) {
      self$position <- self$position + 1
      if (self$position < 2) list(observation = 0, reward = 0, terminated = FALSE) else out
    })
    env$reset()
    env$step(0)
    expect_error(env$step(0), words, fixed = TRUE, class = class)
    # Side by side it is the same error.
    cnd <- expect_error(rollout(env, policy_random(), 3, seed = 1, max_steps = 9), class = class)
    expect_match(conditionMessage(cnd), words, fixed = TRUE)
  }
  good <- list(observation = 0, reward = 0, terminated = FALSE)
  with <- function(...) utils::modifyList(good, list(...), keep.null = TRUE)
  refused(NULL, "`step()` of Walk in step 2 of the episode")
  refused(3, "must return a list, not 3")
  refused(good[-3], "lacks `terminated`; it has `observation`, `reward`.")
  refused(good[-1], "lacks `observation`")
  refused(good[-2], "lacks `reward`")
  refused(with(terminated = NA), "must be TRUE or FALSE, not NA")
  refused(with(terminated = c(TRUE, FALSE)), "`terminated`")
  refused(with(truncated = "no"), "must be TRUE or FALSE, not \"no\"")
  refused(with(reward = NA_real_), "The element `reward`")
  refused(with(reward = NaN), "must be a number, not NaN")
  refused(with(reward = 1:2), "must be a number, not 1:2")
  refused(with(reward = "1"), "must be a number, not \"1\"")
  refused(utils::modifyList(good, list(reward = I(list(1)))), "`reward` of the result")
  space <- "gym_error_space"
  refused(with(observation = 4), "not in its space <Discrete 7 from -3>", space)
  refused(with(observation = 0.5), "one whole number", space)
  refused(with(observation = c(1, 2)), "one whole number", space)
  refused(with(observation = NULL), "one whole number", space)
  refused(with(observation = "left"), "The value \"left\" does not fit", space)
  env <- local_walk(step = function(self, action) with(info = 3))
  env$reset()
  expect_error(env$step(0), "`info` of the result .* must be a list, not 3",
               class = "gym_error_argument")
})

test_that("an observation of numbers must have its shape, its type and its bounds", {
  skip_unless_all()
  refused <- function(observation, words) {
    env <- gym_env(
      reset = function(self) c(0, 0),
      step = function(self, action) {
        list(observation = observation, reward = 0, terminated = FALSE)
      },
      observation_space = space_box(c(-1, -Inf), c(1, Inf)), action_space = space_discrete(2),
      id = "Numbers"
    )
    env$reset()
    expect_error(env$step(0), words, class = "gym_error_space")
    expect_error(rollout(env, policy_random(), 2, seed = 1, max_steps = 9), words,
                 class = "gym_error_space")
  }
  refused(1, "of length 2")
  refused(c(1, 2, 3), "of length 2")
  refused(matrix(0, 1, 2), "of length 2")
  refused(c("a", "b"), "numeric")
  refused(c(TRUE, FALSE), "numeric")
  refused(list(0, 0), "numeric")
  refused(c(2, 0), "At `\\$\\[0\\]|At `\\[0\\]")
  refused(c(0, NaN), "outside of the bounds")
  refused(c(0, NA), "missing value")
  env <- gym_env(
    reset = function(self) c(0, 7),
    step = function(self, action) NULL,
    observation_space = space_box(-1, 1, shape = 2), action_space = space_discrete(2), id = "Reset"
  )
  expect_error(env$reset(), "`reset()` of Reset returned an observation that is not in its space",
               fixed = TRUE, class = "gym_error_space")
})

test_that("bounds are those of the space's own type", {
  # 0.1 as float32 is a little more than 0.1.
  env <- gym_env(
    reset = function(self) 0.1 + 1e-9,
    step = function(self, action) NULL,
    observation_space = space_box(0, 0.1, dtype = "float32"), action_space = space_discrete(2)
  )
  expect_identical(env$reset(), 0.1 + 1e-9)
})

test_that("an action that is none is refused before the function gets it", {
  env <- local_walk()
  env$reset()
  expect_error(env$step(2), "outside of the bounds", class = "gym_error_space")
  expect_error(env$step("right"), "one whole number", class = "gym_error_space")
  expect_identical(env$step(1)$observation, 1L)
  expect_error(rollout(env, function(observation) rep(2, length(observation)), 2),
               "Sub-environment 1: The number is outside", class = "gym_error_space")
  throttle <- gym_env(
    reset = function(self) 0,
    step = function(self, action) list(observation = action[[1]], reward = 0, terminated = TRUE),
    observation_space = space_box(-9, 9), action_space = space_box(-1, 1)
  )
  throttle$reset()
  expect_identical(throttle$step(3)$observation, 3)
  expect_error(throttle$step(NaN), "outside", class = "gym_error_space")
  expect_error(throttle$step(NA_real_), "missing", class = "gym_error_space")
})

test_that("an error in a function names the environment and the step, and keeps its classes", {
  broken <- function(self, action) {
    self$position <- self$position + 1
    if (self$position == 2) rlang::abort("The engine stalled.", class = "engine_error", heat = 9)
    list(observation = 0, reward = 0, terminated = FALSE)
  }
  env <- local_walk(step = broken)
  env$reset()
  env$step(1)
  cnd <- expect_error(env$step(1), "`step()` of Walk raised an error in step 2 of the episode.",
                      fixed = TRUE, class = "engine_error")
  expect_s3_class(cnd, "gym_error_environment")
  expect_identical(cnd$parent$heat, 9)
  expect_match(conditionMessage(cnd), "The engine stalled.")
  cnd <- expect_error(rollout(env, policy_random(), 3, seed = 1, max_steps = 9),
                      class = "engine_error")
  expect_match(conditionMessage(cnd), "in step 2 of the episode (sub-environment 1).", fixed = TRUE)
  env <- gym_env(
    reset = function(self) stop("no start"), step = broken,
    observation_space = space_discrete(2), action_space = space_discrete(2), id = "Start"
  )
  expect_error(env$reset(), "`reset()` of Start raised an error.", fixed = TRUE,
               class = "gym_error_environment")
})

test_that("an error that a function catches itself is no error", {
  env <- local_walk(step = function(self, action) {
    seen <- tryCatch(stop("inner"), error = function(cnd) 1)
    list(observation = seen, reward = 0, terminated = TRUE)
  })
  env$reset()
  expect_identical(env$step(0)$observation, 1L)
  expect_identical(nrow(rollout(env, policy_random(), 20, seed = 1)$episodes), 20L)
})

test_that("an environment cannot be cloned", {
  expect_error(local_walk()$clone(), "has no `$clone`", fixed = TRUE, class = "gym_error_argument")
})

test_that("a reset that returns nothing and a space that was left out are refused", {
  step <- function(self, action) list(observation = 0, reward = 1, terminated = TRUE)
  box <- space_box(0, 1, shape = 1)
  empty <- gym_env(function(self) NULL, step, box, space_discrete(2), id = "Empty")
  expect_error(empty$reset(), "`reset\\(\\)` of Empty .*not in its space",
               class = "gym_error_space")
  expect_error(rollout(empty, policy_random()), "`reset\\(\\)` of Empty",
               class = "gym_error_space")
  expect_error(gym_env(function(self) 0, step, box), "`action_space` must be a space, not NULL",
               class = "gym_error_argument")
  expect_error(gym_env(function(self) 0, step, action_space = box), "`observation_space` must be",
               class = "gym_error_argument")
})

test_that("an observation whose names are in another order than its space's is refused", {
  space <- space_box(c(position = -1, velocity = -1), 1)
  playing <- function(first, later = first) {
    gym_env(
      reset = function(self) first,
      step = function(self, action) list(observation = later, reward = 0, terminated = TRUE),
      observation_space = space, action_space = space_discrete(2)
    )
  }
  turned <- c(velocity = 0, position = 1)
  expect_error(playing(turned)$reset(), "another order than those of its space: `velocity`",
               class = "gym_error_space")
  expect_error(rollout(playing(turned), policy_random(), seed = 1), "another order",
               class = "gym_error_space")
  env <- playing(c(1, 0), turned)
  env$reset()
  expect_error(env$step(0), "Its order is `position`, `velocity`", class = "gym_error_space")
  # Names of what it was computed from.
  other <- playing(c(angle = 1, angle = 0))$reset()
  expect_identical(other, c(position = 1, velocity = 0))
})
