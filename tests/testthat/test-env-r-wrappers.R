# Plays what was recorded: the observations, rewards and flags of some episodes, one after the
# other. It notes the actions that it gets.
replay <- function(episodes, observation_space, action_space, ...) {
  gym_env(
    function(self) {
      self$episode <- self$episode + 1
      self$at <- 0
      episodes[[self$episode]]$first
    },
    function(self, action) {
      self$at <- self$at + 1
      log$actions <- c(log$actions, list(action))
      episodes[[self$episode]]$steps[[self$at]]
    },
    observation_space = observation_space, action_space = action_space, episode = 0, ...
  )
}

log <- new.env()

record <- function(env, actions, seeds) {
  lapply(seeds, function(seed) {
    first <- unname(env$reset(seed = seed))
    steps <- list()
    for (action in actions) {
      out <- env$step(action)
      out$observation <- unname(out$observation)
      steps <- c(steps, list(out[c("observation", "reward", "terminated", "truncated")]))
      if (out$done) break
    }
    list(first = first, steps = steps)
  })
}

# What Gymnasium's wrapper gives, and what the one in R gives of the same trajectory.
compare_wrapper <- function(id, wrapper, actions, ..., seeds = 1:3) {
  plain <- local_env(id)
  wrapped <- local_env(id |> gym_wrap(wrapper, ...))
  own <- replay(record(plain, actions, seeds), plain$observation_space, wrapped$action_space) |>
    gym_wrap(wrapper, ...)
  list(gymnasium = record(wrapped, actions, seeds), own = record(own, actions, seeds))
}

expect_as_gymnasium <- function(id, wrapper, actions, ...) {
  both <- compare_wrapper(id, wrapper, actions, ...)
  # Gymnasium computes in float32.
  difference <- abs(unlist(both$own) - unlist(both$gymnasium))
  expect_lt(max(difference), 2e-5)
  plain <- record(local_env(id), actions, 1:3)
  expect_false(isTRUE(all.equal(both$gymnasium, plain, tolerance = 0.01)))
}

test_that("observations and rewards are changed as Gymnasium changes them", {
  skip_unless_all()
  test_client()
  right <- as.list(rep(1L, 30))
  expect_as_gymnasium("CartPole-v1", "NormalizeObservation", right)
  expect_as_gymnasium("CartPole-v1", "NormalizeObservation", right, epsilon = 0.1)
  expect_as_gymnasium("CartPole-v1", "NormalizeReward", right)
  expect_as_gymnasium("MountainCarContinuous-v0", "NormalizeReward", as.list(seq(-1, 1, 0.1)),
                      gamma = 0.5, epsilon = 1e-4)
  expect_as_gymnasium("Pendulum-v1", "RescaleObservation", as.list(seq(-2, 2, 0.2)),
                      min_obs = c(-2, -1, -10), max_obs = c(1, 0, 1))
  expect_as_gymnasium("MountainCar-v0", "RescaleObservation", right, min_obs = 0, max_obs = 1)
  expect_as_gymnasium("Pendulum-v1", "ClipReward", as.list(seq(-2, 2, 0.2)), min_reward = -3)
  expect_as_gymnasium("Pendulum-v1", "ClipReward", as.list(seq(-2, 2, 0.2)), min_reward = -4,
                      max_reward = -2)
  expect_as_gymnasium("CartPole-v1", "TimeLimit", right, max_episode_steps = 4)
})

test_that("actions are changed as Gymnasium changes them", {
  test_client()
  given <- as.list(seq(-3, 3, by = 0.5))
  plain <- local_env("Pendulum-v1")
  rescale <- list("RescaleAction", min_action = -3, max_action = 4)
  for (wrapper in list(list("ClipAction"), rescale)) {
    wrapped <- local_env("Pendulum-v1", wrappers = list(wrapper))
    own <- replay(record(plain, given, 1), plain$observation_space, plain$action_space)
    own <- rlang::exec(gym_wrap, own, !!!wrapper)
    expect_equal(own$action_space, wrapped$action_space)
    log$actions <- list()
    record(own, given, 1)
    expect_equal(record(plain, log$actions, 1), record(wrapped, given, 1), tolerance = 1e-6)
    # Pendulum clips them, too.
    highest <- if (wrapper[[1]] == "ClipAction") 2 else 10 / 7
    expect_equal(range(unlist(log$actions)), c(-2, highest))
  }
})

# Walks to the right, by what the action says.
steps_of <- function(vectorized = FALSE, ..., reward = function(x) x,
                     ends = function(x) x >= 3) {
  gym_env(
    function(self) {
      n <- if (vectorized) self$num_envs else 1
      self$x <- matrix(runif(2 * n), n)
      if (vectorized) self$x else self$x[1, ]
    },
    function(self, action) {
      self$x <- self$x + as.vector(action)
      list(
        observation = if (vectorized) self$x else self$x[1, ], reward = reward(self$x[, 1]),
        terminated = ends(self$x[, 1])
      )
    },
    observation_space = space_box(c(x = -10, y = -10), 10), action_space = space_box(0, 1),
    vectorized = vectorized, ...
  )
}

test_that("wrappers of vectorised functions are those of single ones, in each sub-environment", {
  wrap <- function(env) {
    env |>
      gym_wrap("RescaleAction", min_action = -1, max_action = 1) |>
      gym_wrap("ClipAction") |>
      gym_wrap("RescaleObservation", min_obs = c(-1, 0), max_obs = c(1, 100)) |>
      gym_wrap("ClipReward", max_reward = 2) |>
      gym_wrap("TimeLimit", max_episode_steps = 3)
  }
  many <- wrap(steps_of(TRUE, num_envs = 3))
  actions <- c(-2, 0, 5)
  first <- many$reset(seed = 1)
  single <- lapply(1:3, function(i) {
    env <- gym_env(
      function(self) self$x <- c(first[i, 1] * 10, first[i, 2] / 5 - 10),
      function(self, action) {
        self$x <- self$x + action
        list(observation = self$x, reward = self$x[[1]], terminated = FALSE)
      },
      observation_space = space_box(c(x = -10, y = -10), 10), action_space = space_box(0, 1)
    )
    wrap(env)
  })
  for (env in single) env$reset()
  for (step in 1:3) {
    out <- many$step(actions)
    for (i in 1:3) {
      one <- single[[i]]$step(actions[[i]])
      expect_equal(out$observation[i, ], one$observation)
      expect_equal(out$reward[[i]], one$reward)
      expect_identical(out$truncated[[i]], one$truncated)
    }
  }
  expect_identical(out$truncated, rep(TRUE, 3))
  expect_identical(colnames(out$observation), c("x", "y"))
})

test_that("moments of vectorised functions are those of all sub-environments that still play", {
  env <- steps_of(TRUE, num_envs = 3) |> gym_wrap("NormalizeObservation", epsilon = 0.5)
  plain <- steps_of(TRUE, num_envs = 3)
  seen <- plain$reset(seed = 1)
  moments <- running_moments(2)
  expected <- function(rows) t((t(rows) - moments$mean) / sqrt(variance_of(moments) + 0.5))
  moments <- merge_moments(moments, moments_of(seen))
  expect_equal(unclass(env$reset(seed = 1)), expected(seen))
  ended <- c(FALSE, FALSE, FALSE)
  for (step in 1:6) {
    rows <- plain$step(c(0.1, 0.5, 1))
    moments <- merge_moments(moments, moments_of(rows$observation[!ended, , drop = FALSE]))
    expect_equal(env$step(c(0.1, 0.5, 1))$observation, expected(rows$observation))
    ended <- ended | rows$terminated
  }
  expect_identical(ended, c(FALSE, TRUE, TRUE))
})

test_that("the running moments are Gymnasium's", {
  moments <- merge_moments(running_moments(1), moments_of(matrix(c(1, 2, 4))))
  expect_equal(moments$mean, 7 / 3.0001)
  expect_equal(moments$count, 3.0001)
  expect_equal(variance_of(moments), (1e-4 + 3 * 14 / 9 + (7 / 3)^2 * 1e-4 * 3 / 3.0001) / 3.0001)
})

test_that("a number within its bounds stays within them, whatever the rounding", {
  skip_unless_all()
  withr::local_seed(3)
  for (i in 1:200) {
    bounds <- lapply(1:4, function(j) runif(1, -10, 10))
    from <- space_box(min(bounds[[1]], bounds[[2]]), max(bounds[[1]], bounds[[2]]))
    to <- space_box(min(bounds[[3]], bounds[[4]]), max(bounds[[3]], bounds[[4]]))
    rescale <- rescaler(from, to, NULL)
    x <- c(from$low, from$high, runif(5, from$low, from$high))
    y <- vapply(x, rescale, 0)
    expect_true(all(y >= to$low & y <= to$high))
    expect_gt(rescale(from$high + 1), to$high)
  }
})

test_that("infinite bounds stay where they are", {
  env <- gym_env(
    function(self) c(1, 2, 3), function(self, action) NULL,
    observation_space = space_box(c(-Inf, 0, -Inf), c(Inf, Inf, 5)),
    action_space = space_discrete(2)
  )
  moved <- gym_wrap(env, "RescaleObservation", min_obs = c(-Inf, 10, -Inf),
                    max_obs = c(Inf, Inf, 4))
  expect_identical(moved$reset(), c(1, 12, 2))
  expect_error(gym_wrap(env, "RescaleObservation", min_obs = 0, max_obs = 1),
               "`min_obs` must be -Inf where the space is bounded so, not 0.",
               class = "gym_error_argument")
})

test_that("an id that is registered is wrapped when it is made, and played so", {
  gym_register("Steps-v0", steps_of())
  withr::defer(gym_unregister("Steps-v0"))
  wrapped <- "Steps-v0" |>
    gym_wrap("TimeLimit", max_episode_steps = 2) |>
    gym_wrap("ClipReward", max_reward = 0.5)
  expect_s3_class(wrapped, "gym_wrapped")
  played <- rollout(wrapped, policy_random(), episodes = 20, seed = 1)
  expect_identical(played$episodes$length, rep(2L, 20))
  expect_true(all(played$episodes$return <= 1))
  env <- gym_make(wrapped)
  expect_identical(env$spec$max_episode_steps, 2L)
  also <- gym_make("Steps-v0", wrappers = list(list("TimeLimit", max_episode_steps = 2)))
  expect_identical(also$spec$max_episode_steps, 2L)
})

test_that("what remembers earlier episodes plays one after the other, in one batch", {
  for (vectorized in c(FALSE, TRUE)) {
    env <- steps_of(vectorized) |> gym_wrap("NormalizeObservation") |> gym_wrap("NormalizeReward")
    played <- as_vector_env(env)
    expect_identical(played$remembers, c("NormalizeObservation", "NormalizeReward"))
    expect_identical(played$num_envs, if (vectorized) 256L else 1L)
  }
  again <- function(episodes) {
    env <- steps_of() |> gym_wrap("NormalizeReward")
    rollout(env, policy_random(), episodes = episodes, seed = 4)$episodes$return
  }
  expect_identical(again(30)[1:20], again(20))
})

test_that("an object of a class is wrapped, too", {
  steps_class <- R6::R6Class(
    "Steps", inherit = GymEnv,
    public = list(
      x = 0,
      initialize = function() {
        super$initialize(observation_space = space_box(0, 1), action_space = space_discrete(2))
      },
      reset = function() self$x <- runif(1),
      step = function(action) list(observation = self$x, reward = 5, terminated = FALSE)
    )
  )
  env <- gym_wrap(gym_wrap(steps_class$new(), "ClipReward", max_reward = 1), "TimeLimit",
                  max_episode_steps = 2)
  expect_identical(env$reset(seed = 1), steps_class$new()$reset(seed = 1))
  out <- env$step(1)
  expect_identical(out$reward, 1)
  expect_true(env$step(1)$truncated)
  expect_identical(nrow(check_env(env)), 0L)
})

test_that("a wrapped environment is one in which nothing is wrong", {
  for (vectorized in c(FALSE, TRUE)) {
    env <- steps_of(vectorized) |>
      gym_wrap("RescaleObservation", min_obs = -1, max_obs = 1) |>
      gym_wrap("RescaleAction", min_action = -1, max_action = 1)
    expect_identical(nrow(check_env(env)), 0L)
    remembering <- check_env(gym_wrap(env, "NormalizeObservation"))
    expect_match(remembering$finding, "NormalizeObservation remembers earlier episodes")
  }
})

test_that("a mistake in a wrapped environment is the same sentence as in a plain one", {
  broken <- function(...) {
    gym_env(
      function(self) c(0, 0), function(self, action) list(...), id = "Broken",
      observation_space = space_box(c(-1, -1), 1), action_space = space_discrete(2)
    )
  }
  message <- function(env) {
    env$reset()
    tryCatch(env$step(1), error = conditionMessage)
  }
  for (env in list(broken(observation = c(0, 0)), broken(observation = "a", reward = "b"),
                   broken(observation = 1:3, reward = 1, terminated = TRUE),
                   broken(observation = c(0, 0), reward = 1, terminated = 0))) {
    wrapped <- env |>
      gym_wrap("NormalizeObservation") |>
      gym_wrap("NormalizeReward") |>
      gym_wrap("ClipReward", min_reward = 0)
    expect_identical(sub("<.*?>", "", message(wrapped)), sub("<.*?>", "", message(env)))
  }
})

test_that("a wrapper or an argument that there is not is an error that lists what there is", {
  env <- steps_of()
  wrong <- function(object, message) {
    expect_error(object, message, fixed = TRUE, class = "gym_error_argument")
  }
  wrong(gym_wrap(env, "FrameStack"), "There is no wrapper \"FrameStack\" for environments")
  wrong(gym_wrap(env, "FrameStack"), "There are TimeLimit, ClipAction, RescaleAction")
  gym_register("Steps-v0", env)
  withr::defer(gym_unregister("Steps-v0"))
  wrong(gym_wrap("Steps-v0", "FrameStack"), "There is no wrapper \"FrameStack\"")
  wrong(gym_wrap(env, 3), "`wrapper` must be a string")
  wrong(gym_wrap(3, "TimeLimit"), "`env_id` must be")
  wrong(gym_wrap(list(), "TimeLimit"), "`env_id` must be the id of an environment, or one made by")
  wrong(gym_wrap(env, "TimeLimit", 3), "Further arguments need names")
  wrong(gym_wrap(env, "TimeLimit"),
        "TimeLimit needs the argument `max_episode_steps`: its arguments are `max_episode_steps`.")
  wrong(gym_wrap(env, "TimeLimit", steps = 3), "TimeLimit has no argument `steps`: its arguments")
  wrong(gym_wrap(env, "ClipAction", low = 3), "ClipAction has no argument `low`: it has none.")
  wrong(gym_wrap(env, "TimeLimit", max_episode_steps = 0), "`max_episode_steps` must be")
  wrong(gym_wrap(env, "ClipReward"), "ClipReward needs `min_reward` or `max_reward`, or both.")
  wrong(gym_wrap(env, "ClipReward", min_reward = 2, max_reward = 1),
        "`max_reward` must be at least `min_reward`, which is 2, not 1.")
  wrong(gym_wrap(env, "RescaleAction", min_action = 1, max_action = 1), "`max_action` must be ab")
  wrong(gym_wrap(env, "RescaleAction", min_action = 2, max_action = 1), "`max_action` must be at l")
  wrong(gym_wrap(env, "RescaleAction", min_action = 1:3, max_action = 1),
        "`min_action` must be a single number or of length 1, not 1:3.")
  wrong(gym_wrap(env, "RescaleObservation", min_obs = "a", max_obs = 1), "`min_obs` must be numb")
  wrong(gym_wrap(env, "NormalizeObservation", epsilon = 0), "`epsilon` must be a number above 0")
  wrong(gym_wrap(env, "NormalizeReward", gamma = 2), "`gamma` must be a number from 0 to 1, not 2.")
  words <- gym_env(
    function(self) "a", function(self, action) NULL,
    observation_space = space_text(1), action_space = space_discrete(2)
  )
  wrong(gym_wrap(words, "ClipAction"), "ClipAction is for actions that are a Box, and these are <D")
  wrong(gym_wrap(words, "RescaleObservation", min_obs = 0, max_obs = 1), "observations that are")
  wrong(gym_wrap(words, "NormalizeObservation"), "NormalizeObservation is for observations")
})
