test_that("a frame is what the environment draws", {
  env <- local_env(seed = 1)
  env$reset()
  frame <- env_render(env$client, env$instance_id)
  expect_s3_class(frame, "gym_frame")
  expect_equal(dim(frame), c(400, 600, 3))
  expect_type(frame, "integer")
  expect_output(print(frame), "600 x 400 pixels")
  # CartPole's background is white, its cart black.
  expect_equal(frame[1, 1, ], c(255, 255, 255))
  expect_true(any(frame == 0))
  expect_identical(env$render(), frame)
})

test_that("a frame follows the environment", {
  env <- local_env(seed = 1)
  env$reset()
  before <- env$render()
  for (i in 1:8) env$step(1)
  expect_false(identical(env$render(), before))
})

test_that("a frame is that of the sub-environment asked for", {
  for (mode in c("sync", "vector_entry_point")) {
    env <- local_env(num_envs = 3, vectorization_mode = mode, seed = 1)
    env$reset()
    # The carts of the sub-environments go apart.
    for (i in 1:8) env$step(c(0, 1, 1))
    frames <- lapply(1:3, env$render)
    expect_identical(env$render(), frames[[1]])
    expect_false(identical(frames[[1]], frames[[2]]))
    cart <- vapply(frames[1:2], function(frame) {
      mean(col(frame[, , 1])[frame[, , 1] == 0 & row(frame[, , 1]) < 320])
    }, 0)
    expect_lt(cart[[1]], cart[[2]])
    expect_error(env$render(4), class = "gym_error_http_400")
    expect_error(env$render(0), class = "gym_error_argument")
  }
  expect_error(local_env()$render(2), class = "gym_error_http_400")
})

test_that("a frame knows plot() and as.raster()", {
  skip_if_not_installed("png")
  env <- local_env(seed = 1)
  env$reset()
  frame <- env$render()
  raster <- as.raster(frame)
  expect_equal(dim(raster), c(400, 600))
  expect_equal(as.matrix(raster)[1, 1], "#FFFFFF")
  file <- withr::local_tempfile(fileext = ".png")
  png(file)
  expect_invisible(plot(frame))
  dev.off()
  drawn <- png::readPNG(file)
  expect_true(any(drawn[, , 1] < 0.1))
})

test_that("grey and half transparent frames are shown, too", {
  skip_unless_all()
  server <- odd_server()
  shades <- c("1" = "#0A0A0A", "3" = "#0A141E", "4" = "#0A141EFF")
  grounds <- c("1" = "#646464", "3" = "#646464", "4" = "#64646464")
  for (channels in c("1", "3", "4")) {
    env <- make_odd(paste0("Drawing", channels), server)
    env$reset()
    env$step(0)
    frame <- env$render()
    expect_identical(dim(frame), c(4L, 6L, as.integer(channels)))
    raster <- as.matrix(as.raster(frame))
    expect_identical(dim(raster), c(4L, 6L))
    expect_identical(raster[2, 2], shades[[channels]])
    expect_identical(raster[1, 1], grounds[[channels]])
    grDevices::pdf(NULL)
    expect_invisible(plot(frame))
    grDevices::dev.off()
  }
})

test_that("an environment that was not reset has no frame", {
  error <- expect_error(local_env()$render(), class = "gym_error_http_400")
  expect_identical(error$code, "reset_needed")
})

test_that("an environment that cannot be drawn says so", {
  skip_unless_all()
  env <- make_odd("Image", odd_server())
  env$reset()
  error <- expect_error(env$render(), class = "gym_error_http_400")
  expect_identical(error$code, "cannot_render")
})

test_that("drawing works for all of classic control, while others are closed", {
  for (id in c("CartPole-v1", "MountainCar-v0", "MountainCarContinuous-v0", "Acrobot-v1",
               "Pendulum-v1")) {
    env <- local_env(id, seed = 1)
    env$reset()
    expect_s3_class(env$render(), "gym_frame")
    env$close()
  }
})

# The frames of an episode ----------------------------------------------------------------

test_that("there is a frame before the first step and one after each", {
  played <- short_rollout(episodes = 3)
  expect_length(played$frames, 3)
  expect_identical(lengths(played$frames), played$episodes$length + 1L)
  expect_s3_class(played$frames[[1]], "gym_frames")
  expect_null(rollout("CartPole-v1", policy_random(), client = test_client())$frames)
})

test_that("the frames are what the environment draws when the episode is played again", {
  skip_if_not_installed("png")
  played <- short_rollout(max_steps = 4, episodes = 2)
  env <- local_env("CartPole-v1")
  for (episode in 1:2) {
    frames <- played$frames[[episode]]
    env$reset(seed = played$episodes$seed[episode])
    expect_identical(frames[[1]], env$render())
    for (step in 1:4) {
      env$step(played$steps$action[played$steps$episode == episode][step])
      expect_identical(frames[[step + 1]], env$render())
    }
  }
})

test_that("frames change nothing of what a single environment plays, nor what is drawn", {
  skip_unless_all()
  env <- local_env("CartPole-v1")
  without <- rollout(env, policy_random(), episodes = 3, seed = 1, steps = TRUE)
  with <- rollout(env, policy_random(), episodes = 3, seed = 1, steps = TRUE, frames = TRUE)
  expect_identical(with[c("episodes", "steps")], without[c("episodes", "steps")])
  by_id <- rollout("CartPole-v1", policy_random(), 3, seed = 1, frames = TRUE,
                   client = test_client())
  expect_identical(by_id$episodes, without$episodes)
  expect_null(by_id$num_envs)
})

test_that("an environment that was made for the frames is closed", {
  server <- local_server()
  rollout("CartPole-v1", policy_random(), max_steps = 2, frames = TRUE, client = server)
  expect_length(env_list_all(server), 0)
})

test_that("frames print, and unpack when they are taken out", {
  skip_if_not_installed("png")
  frames <- short_rollout(max_steps = 3)$frames[[1]]
  expect_output(print(frames), "<gym_frames: 4 frames of 600 x 400 pixels, 50 a second>",
                fixed = TRUE)
  expect_s3_class(frames[2:3], "gym_frames")
  expect_length(frames[2:3], 2)
  expect_identical(frames[2:3][[2]], frames[[3]])
  expect_identical(lapply(frames, dim), rep(list(c(400L, 600L, 3L)), 4))
  expect_error(frames[[5]], "subscript out of bounds")
})

test_that("grey and half transparent frames are kept as they are", {
  skip_unless_all()
  skip_if_not_installed("png")
  server <- odd_server()
  for (channels in c(1, 3, 4)) {
    env <- make_odd(paste0("Drawing", channels), server)
    frames <- rollout(env, policy_random(), frames = TRUE)$frames[[1]]
    expect_length(frames, 6)
    env$reset()
    expect_identical(frames[[1]], env$render())
    expect_identical(attr(frames, "fps"), 10L)
  }
})

test_that("an environment that cannot be drawn is refused before anything is played", {
  skip_unless_all()
  env <- make_odd("Image", odd_server())
  error <- expect_error(rollout(env, policy_random(), frames = TRUE), "Image-v0 cannot be drawn",
                        class = "gym_error_argument")
  expect_identical(error$argument, "frames")
  # It was never reset.
  expect_error(env$render(), class = "gym_error_http_400")
  expect_error(env$step(0), "needs a running episode")
  fake <- fake_environment()
  expect_error(rollout(fake, policy_random(), frames = TRUE), "cannot be drawn",
               class = "gym_error_argument")
  expect_length(fake$seeds, 0)
})

test_that("a vector environment is refused, and a flag must be one", {
  env <- local_env("CartPole-v1", num_envs = 2)
  expect_error(rollout(env, policy_random(), frames = TRUE), "has 2 sub-environments",
               class = "gym_error_argument")
  expect_error(rollout("CartPole-v1", policy_random(), frames = 1, client = no_client()),
               "`frames` must be TRUE or FALSE", class = "gym_error_argument")
})

test_that("several sub-environments whose frames are wanted are refused, however they are named", {
  drawn <- gym_env(
    function(self) 0, function(self, action) list(observation = 0, reward = 1, terminated = TRUE),
    space_discrete(1), space_discrete(2), render = function(self) array(255L, c(8, 8, 3))
  )
  gym_register("Drawn-v0", drawn)
  withr::defer(gym_unregister("Drawn-v0"))
  play <- function(env, num_envs) {
    rollout(env, policy_random(), frames = TRUE, num_envs = num_envs, client = no_client())
  }
  for (env in list("CartPole-v1", gym_wrap("CartPole-v1", "ClipReward"), "Drawn-v0")) {
    cnd <- expect_error(play(env, 4), "`num_envs` must be 1 to keep frames, not 4",
                        class = "gym_error_argument")
    expect_identical(cnd$argument, "num_envs")
  }
  expect_length(play("Drawn-v0", 1)$frames, 1)
})

test_that("an environment has its number of frames a second", {
  skip_unless_all()
  expect_identical(local_env("CartPole-v1")$spec$render_fps, 50L)
  expect_identical(local_env("CartPole-v1", num_envs = 2)$spec$render_fps, 50L)
  expect_null(make_odd("Image", odd_server())$spec$render_fps)
})

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
