local_drawn <- function(render, ...) {
  gym_env(
    reset = function(self) {
      self$at <- 1
      self$at
    },
    step = function(self, action) {
      self$at <- self$at + 1
      list(observation = self$at, reward = 0, terminated = self$at == 4)
    },
    observation_space = space_discrete(9), action_space = space_discrete(2), render = render,
    id = "Drawn", ...
  )
}

plots <- function(self) {
  plot(self$at, 1, xlim = c(0, 5))
  TRUE
}

test_that("a function that plots gives a frame, and leaves the session's devices as they were", {
  skip_if_not_installed("png")
  grDevices::pdf(NULL)
  before <- grDevices::dev.cur()
  withr::defer(grDevices::dev.off(before))
  grDevices::pdf(NULL)
  other <- grDevices::dev.cur()
  withr::defer(grDevices::dev.off(other))
  env <- local_drawn(plots)
  env$reset()
  frame <- env$render()
  expect_s3_class(frame, "gym_frame")
  expect_identical(dim(frame), c(400L, 600L, 3L))
  expect_identical(grDevices::dev.cur(), other)
  expect_gt(length(unique(as.vector(frame))), 2)
  env$step(0)
  expect_false(identical(env$render(), frame))
})

test_that("a picture that is returned is the frame, enlarged where it is small", {
  pictures <- list(
    raster = as.raster(matrix(c("red", "blue"), 1)),
    colours = matrix(c("#FF0000", "blue"), 1),
    array = array(c(255, 0, 0, 0, 0, 255), c(1, 2, 3)),
    shares = array(c(1, 0, 0, 0, 0, 1), c(1, 2, 3))
  )
  for (picture in pictures) {
    env <- local_drawn(function(self) picture)
    env$reset()
    frame <- env$render()
    expect_identical(dim(frame), c(120L, 240L, 3L))
    expect_identical(frame[1, 1, ], c(255L, 0L, 0L))
    expect_identical(frame[120, 240, ], c(0L, 0L, 255L))
  }
  env <- local_drawn(function(self) matrix(c(0, 0.5), 300, 300))
  env$reset()
  expect_identical(dim(env$render()), c(300L, 300L, 3L))
})

test_that("rollout() keeps frames, which filmstrip and animation show", {
  skip_unless_all()
  skip_if_not_installed("png")
  for (render in list(plots, function(self) matrix(self$at / 9, 2, 2))) {
    env <- local_drawn(render, render_fps = 4)
    played <- rollout(env, policy_random(), 2, seed = 1, frames = TRUE)
    expect_length(played$frames, 2)
    expect_length(played$frames[[1]], 4)
    expect_s3_class(played$frames[[2]][[4]], "gym_frame")
    grDevices::pdf(NULL)
    plot(played, type = "filmstrip")
    grDevices::dev.off()
    skip_if_not_installed("magick")
    withr::local_options(gym.viewer = FALSE)
    expect_identical(animate(played)$steps, 0:3)
    expect_identical(animate(policy_random(), env = env, seed = 1)$steps, 0:3)
  }
})

test_that("a vectorised environment is drawn with one sub-environment", {
  skip_if_not_installed("png")
  env <- gym_env(
    reset = function(self) rep(0, self$num_envs),
    step = function(self, action) {
      n <- self$num_envs
      list(observation = rep(0, n), reward = rep(1, n), terminated = rep(TRUE, n))
    },
    observation_space = space_discrete(2), action_space = space_discrete(2), vectorized = TRUE,
    render = function(self) matrix(self$num_envs == 1, 9, 9)
  )
  frame <- rollout(env, policy_random(), frames = TRUE, seed = 1)$frames[[1]][[1]]
  expect_true(all(frame == 255))
})

test_that("drawing leaves the session's generator as it was", {
  withr::local_seed(1)
  env <- local_drawn(function(self) matrix(runif(4), 2))
  env$reset(seed = 1)
  before <- .Random.seed
  env$render()
  expect_identical(.Random.seed, before)
})

test_that("what cannot be drawn is refused with the fix", {
  env <- local_drawn(NULL)
  env$reset()
  expect_error(env$render(), "Drawn cannot be drawn", class = "gym_error_argument")
  expect_error(rollout(env, policy_random(), frames = TRUE), "cannot be drawn",
               class = "gym_error_argument")
  expect_error(as_vector_env(local_drawn(plots), num_envs = 2, frames = TRUE),
               "`num_envs` must be 1", class = "gym_error_argument")
  env <- local_drawn(function(self) NULL)
  expect_error(env$render(), "has not been reset", class = "gym_error_argument")
  env$reset()
  expect_error(env$render(), "drew nothing and returned NULL", class = "gym_error_argument")
  env <- local_drawn(function(self) stop("no ink"))
  env$reset()
  expect_error(env$render(), "`render()` of Drawn raised an error", fixed = TRUE,
               class = "gym_error_environment")
  env <- local_drawn(function(self) matrix("no colour", 2, 2))
  env$reset()
  expect_error(env$render(), "raised an error", class = "gym_error_environment")
})

test_that("a frame that fails during play names the user's call", {
  env <- gym_env(
    reset = function(self) 0,
    step = function(self, action) list(observation = 0, reward = 0, terminated = TRUE),
    render = function(self) list(1), observation_space = space_discrete(1),
    action_space = space_discrete(2)
  )
  failed <- expect_error(rollout(env, policy_random(), frames = TRUE), "drew nothing",
                         class = "gym_error_argument")
  expect_identical(failed$call[[1L]], quote(rollout))
})
