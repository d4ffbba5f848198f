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
  server <- local_odd_server()
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
  env <- make_odd("Image", local_odd_server())
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
