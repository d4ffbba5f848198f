# Walks to the right by 1, or by `action`, from a place that is drawn. In a vectorised environment
# what comes of an episode that has ended is nonsense.
walk <- function(vectorized = FALSE, ..., size = 3) {
  gym_env(
    function(self) {
      n <- if (vectorized) self$num_envs else 1
      self$x <- matrix(runif(2 * n), n)
      self$over <- logical(n)
      if (vectorized) self$x else self$x[1, ]
    },
    function(self, action) {
      self$x <- self$x + action
      out <- list(
        observation = if (vectorized) self$x else self$x[1, ], reward = self$x[, 1],
        terminated = self$x[, 1] >= size
      )
      out$observation[self$over] <- NA
      out$reward[self$over] <- NA
      self$over <- self$over | out$terminated
      out
    },
    observation_space = space_box(c(x = -Inf, y = -Inf), Inf), action_space = space_discrete(3),
    vectorized = vectorized, id = "Walk", max_episode_steps = 20, reward_threshold = 5, ...
  )
}

ahead <- function(observation) observation[, "x"] > 0.5

steps_of <- function(env, policy = ahead) {
  as.data.frame(rollout(env, policy, 20, seed = 1, steps = TRUE, next_observation = TRUE))
}

test_that("a function of R changes rewards, and gets what it asks for by name", {
  for (vectorized in c(FALSE, TRUE)) {
    plain <- steps_of(walk(vectorized))
    wrapped <- walk(vectorized) |> gym_wrap("TransformReward", func = function(r) r / 10)
    expect_equal(steps_of(wrapped)$reward, plain$reward / 10)
    expect_equal(wrapped$spec[c("wrappers", "reward_threshold")],
                 list(wrappers = "TransformReward", reward_threshold = NULL))
    everything <- function(terminated, observation, reward, next_observation, action, truncated) {
      stopifnot(is.matrix(observation), is.logical(truncated))
      reward + 10 * observation[, "x"] + 100 * next_observation[, "y"] + 1e3 * action +
        1e4 * terminated
    }
    expect_equal(
      steps_of(gym_wrap(walk(vectorized), "TransformReward", func = everything))$reward,
      plain$reward + 10 * plain$x + 100 * plain$next_y + 1e3 * plain$action +
        1e4 * plain$terminated
    )
  }
})

test_that("a function of R changes observations and actions, and their spaces", {
  for (vectorized in c(FALSE, TRUE)) {
    plain <- steps_of(walk(vectorized), function(observation) 2 * (observation[, "x"] > 0.5))
    wrapped <- walk(vectorized) |>
      gym_wrap("TransformAction", func = function(action) 2 * action,
               action_space = space_discrete(2)) |>
      gym_wrap("TransformObservation", func = function(observation) rowSums(observation),
               observation_space = space_box(c(sum = -Inf), Inf)) |>
      gym_wrap("TransformObservation", func = function(observation) cbind(observation, 1),
               observation_space = space_box(c(x = -Inf, one = 1), c(Inf, 1)))
    expect_identical(wrapped$single_action_space$n, 2L)
    played <- steps_of(wrapped, function(observation) rep(1, nrow(observation)))
    expect_equal(played$next_x[played$episode == 1][[1]] - played$x[[1]], 4)
    expect_true(all(played$one == 1))
    back <- walk(vectorized) |>
      gym_wrap("TransformAction", func = function(action, observation) 1 * (observation[, 1] > 0.5))
    expect_identical(
      steps_of(back, policy_random()), replace(steps_of(walk(vectorized)), "action",
                                               steps_of(back, policy_random())["action"])
    )
  }
})

test_that("it goes around other wrappers and inside of them, around an id", {
  skip_unless_all()
  ten <- function(env) gym_wrap(env, "TransformReward", func = function(reward) 10 * reward)
  clip <- function(env) gym_wrap(env, "TransformReward", func = function(r) pmin(r, 1))
  expect_identical(max(steps_of(ten(clip(walk())))$reward), 10)
  expect_identical(max(steps_of(clip(ten(walk())))$reward), 1)
  gym_register("Walk-v9", walk())
  withr::defer(gym_unregister("Walk-v9"))
  env <- "Walk-v9" |> gym_wrap("TransformReward", func = function(reward) -reward) |>
    gym_wrap("TimeLimit", max_episode_steps = 1)
  short <- gym_wrap(walk(), "TimeLimit", max_episode_steps = 1)
  expect_equal(steps_of(env)$reward, -steps_of(short)$reward)
  expect_error(gym_wrap("Walk-v9", "TransformReward", func = 1), class = "gym_error_argument")
})

test_that("the only argument of a function may have any name, others are what there is", {
  wrong <- function(func, text, wrapper = "TransformReward") {
    expect_error(gym_wrap(walk(), wrapper, func = func), text, fixed = TRUE,
                 class = "gym_error_argument")
  }
  wrong(3, "`func` must be a function of `reward`, not 3.")
  wrong(function() 1, "must be a function of `reward`, and this one has no argument.")
  wrong(function(obs) 1, "this one needs `obs`.")
  wrong(function(reward, next_obs) 1, "this one needs `next_obs`.")
  wrong(function(reward, x) 1, "`terminated`, `truncated`.")
  wrong(function(observation, reward) 1, "needs `reward`", "TransformObservation")
  expect_error(gym_wrap(walk(), "TransformReward"), "needs the argument `func`")
  for (func in list(sqrt, function(x) sqrt(x), function(reward, power = 0.5) reward^power,
                    function(r, scale = 1) sqrt(r) * scale, function(...) sqrt(...))) {
    env <- gym_wrap(walk(), "TransformReward", func = func)
    first <- env$reset(seed = 1)
    expect_equal(env$step(1)$reward, sqrt(first[["x"]] + 1))
  }
})

test_that("what a function returns is checked, and the environment goes on", {
  shows <- function(env, text, class = "gym_error_wrapper") {
    env$reset(seed = 1)
    error <- expect_error(env$step(1), text, fixed = TRUE, class = class)
    expect_error(env$step(1), text, fixed = TRUE, class = class)
    expect_identical(error$argument, "func")
    expect_error(rollout(env, ahead, seed = 1), text, fixed = TRUE, class = class)
  }
  reward <- function(func) gym_wrap(walk(), "TransformReward", func = func)
  shows(reward(function(r) NA), "`func` of TransformReward must return a finite number for one")
  shows(reward(function(r) c(r, r)), "not c(")
  shows(reward(function(r) r / 0), "not Inf")
  shows(reward(function(r) "a"), "not \"a\"")
  shows(reward(function(r) stop("oops")), "`func` of TransformReward raised an error",
        "gym_error_environment")
  own <- function(r) rlang::abort("mine", class = "my_error")
  shows(reward(own), "raised an error", "my_error")
  action <- function(a) a + 7
  shows(gym_wrap(walk(), "TransformAction", func = action), "must return 1 action of <Discrete 3>",
        "gym_error_space")
  once <- TRUE
  env <- gym_wrap(walk(), "TransformObservation", func = function(observation) {
    if (once) observation else cbind(observation, 1)
  })
  env$reset(seed = 1)
  once <- FALSE
  expect_error(env$step(1), "the new one as `observation_space`", class = "gym_error_space")
  once <- TRUE
  expect_length(env$step(1)$observation, 2)
  many <- gym_wrap(walk(TRUE), "TransformReward", func = function(r) ifelse(r > 0, NA, r))
  expect_error(rollout(many, ahead, 300, seed = 1), "each of 256 rewards, not NA in row 1")
  # A mistake of the environment's own is told as one.
  bad <- gym_env(
    function(self) 0, function(self, action) list(observation = 7, reward = 1, terminated = TRUE),
    observation_space = space_discrete(2), action_space = space_discrete(2)
  )
  bad <- gym_wrap(bad, "TransformReward", func = function(r) r)
  bad$reset()
  expect_error(bad$step(0), "returned an observation that is not in its space")
})

test_that("a function that takes a number of the first row for that of each is warned of", {
  env <- walk(TRUE) |>
    gym_wrap("TransformReward", func = function(reward, observation) reward - observation[1])
  expect_warning(rollout(env, ahead, seed = 1), "gives a row another value when it is alone",
                 class = "gym_warning_wrapper")
  # What is wrong in later steps only is found, too.
  same <- gym_wrap(walk(TRUE), "TransformReward", func = function(reward, observation) {
    reward - (reward > 2) * observation[1]
  })
  expect_warning(rollout(same, policy_random(), seed = 1), class = "gym_warning_wrapper")
  draws <- gym_wrap(walk(TRUE), "TransformReward", func = function(r) r + rnorm(length(r)))
  expect_no_warning(first <- rollout(draws, ahead, 5, seed = 1))
  expect_identical(rollout(draws, ahead, 5, seed = 1)$episodes, first$episodes)
})

test_that("a computed observation may be beyond a bound by a rounding, and no more", {
  sent <- function(x) {
    env <- gym_env(
      function(self) 0, function(self, action) list(observation = x, reward = 1, terminated = TRUE),
      space_box(0, 100, shape = 1), space_discrete(1), id = "Sent"
    )
    parts <- space_dict(at = space_box(0, 100, shape = 1), all = space_box(c(0, 0), c(9, 100)))
    func <- function(observation) list(at = observation, all = cbind(0, observation))
    list(env, gym_wrap(env, "TransformObservation", func = func, observation_space = parts))
  }
  for (env in c(sent(100 + 9e-5), sent(-9e-7))) {
    expect_identical(rollout(env, policy_random(), seed = 1)$episodes$return, 1)
    expect_false("wrong" %in% check_env(env)$severity)
  }
  for (env in sent(100 + 2e-4)) {
    error <- expect_error(rollout(env, policy_random(), seed = 1), class = "gym_error_space")
    text <- rlang::cnd_message(error)
    expect_match(text, "here is a number outside of the bounds 0 and 100: 100.0002", fixed = TRUE)
    expect_no_match(text, "policy")
  }
  # The question whether a value is a member has Gymnasium's answer.
  expect_false(space_contains(space_box(0, 100), 100 + 9e-5))
})
