frames_of_length <- function(n) new_frames(lapply(seq_len(n), function(i) as.raw(i)))

test_that("stills are evenly apart, the first and the last among them", {
  stills <- pick_stills(frames_of_length(201), 8)
  expect_identical(stills$steps, c(0L, 29L, 57L, 86L, 114L, 143L, 171L, 200L))
  expect_true(all(abs(diff(stills$steps) - 200 / 7) <= 1))
  expect_identical(unlist(unclass(stills$frames)), as.raw(stills$steps + 1))
  expect_identical(pick_stills(frames_of_length(3), 8)$steps, 0:2)
  expect_identical(pick_stills(frames_of_length(30), 2)$steps, c(0L, 29L))
  expect_identical(pick_stills(frames_of_length(30), 1)$steps, 0L)
})

test_that("blank borders are cut off, the same of all", {
  blank <- array(255L, c(100, 200, 3))
  one <- two <- blank
  one[41:45, 21:30, 1] <- 0L
  two[56:60, 91:100, 2] <- 0L
  cropped <- crop_blank(list(one, two))
  # A twentieth stays around what is drawn.
  expect_identical(cropped[[1]], one[36:65, 11:110, ])
  expect_identical(cropped[[2]], two[36:65, 11:110, ])
  expect_identical(crop_blank(list(blank)), list(blank))
  all_over <- blank
  all_over[c(1, 100), c(1, 200), ] <- 0L
  expect_identical(crop_blank(list(all_over)), list(all_over))
})

test_that("a smaller picture has the mean of each square", {
  picture <- array(1:36, c(4, 3, 3))
  small <- shrink(picture, 2L)
  expect_identical(dim(small), c(2L, 1L, 3L))
  expect_identical(small[2, 1, 3], as.integer(round(mean(picture[3:4, 1:2, 3]))))
  expect_identical(shrink(picture, 1L), picture)
})

test_that("a filmstrip has a panel for each frame", {
  skip_if_not_installed("png")
  picture <- drawn(ggplot2::autoplot(short_rollout(), type = "filmstrip", n = 5))
  panels <- ggplot2::ggplot_build(picture)$layout$layout
  expect_identical(panels$COL, c(1L, 2L, 1L, 2L, 1L))
  square <- lapply(1:5, function(i) array(i, c(9, 9, 3)))
  four <- drawn(filmstrip(list(frames = square, steps = 0:4)))
  expect_identical(ggplot2::ggplot_build(four)$layout$layout$COL, c(1L, 2L, 3L, 4L, 1L))
  expect_match(as.character(panels$step), "^step [0-9]+$")
  file <- withr::local_tempfile(fileext = ".png")
  grDevices::png(file, 300, 200)
  print(picture)
  grDevices::dev.off()
  pixels <- png::readPNG(file)
  # The poles.
  expect_gt(mean(pixels[, , 1] - pixels[, , 3] > 0.2), 0.001)
})

test_that("a rollout without frames says how to get them", {
  plain <- rollout("CartPole-v1", policy_random(), seed = 1, client = test_client())
  expect_error(plot(plain, type = "filmstrip"), "frames = TRUE", class = "gym_error_argument")
  expect_error(plot(short_rollout(), type = "filmstrip", n = 0), "`n`",
               class = "gym_error_argument")
})
