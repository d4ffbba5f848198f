# Pictures of 8 x 6 pixels in which a dot has moved.
dotted <- function(x, y, colour = c(1, 0, 0)) {
  picture <- array(1, c(6, 8, 3))
  picture[y, x, ] <- colour
  png::writePNG(picture)
}

read_gif <- function(pngs, delays = rep(2, length(pngs)), ...) {
  file <- withr::local_tempfile(fileext = ".gif")
  write_gif(pngs, file, delays, ...)
  magick::image_read(file)
}

pixels_of <- function(image) as.vector(as.integer(magick::image_data(image, "rgb")))

test_that("the pictures read back are those written", {
  skip_if_not_installed("magick")
  skip_if_not_installed("png")
  pngs <- list(dotted(1, 1), dotted(8, 6), dotted(8, 6), dotted(4, 2, c(0, 0.4, 0.8)))
  read <- magick::image_coalesce(read_gif(pngs))
  expect_length(read, 4)
  for (i in seq_along(pngs)) {
    expect_identical(pixels_of(read[i]), pixels_of(magick::image_read(pngs[[i]])))
  }
})

test_that("delays and loop stand in the file", {
  skip_if_not_installed("magick")
  skip_if_not_installed("png")
  file <- withr::local_tempfile(fileext = ".gif")
  expect_identical(write_gif(list(dotted(1, 1), dotted(2, 2)), file, c(2, 300)), c(8L, 6L))
  bytes <- readBin(file, "raw", 1e5)
  expect_identical(rawToChar(bytes[1:6]), "GIF89a")
  control <- which(bytes == as.raw(0x21) & c(bytes[-1], as.raw(0)) == as.raw(0xf9))
  delay <- function(at) as.integer(bytes[at + 4]) + 256L * as.integer(bytes[at + 5])
  expect_identical(vapply(control, delay, 1L), c(2L, 300L))
  expect_length(grepRaw("NETSCAPE2.0", bytes), 1)
})

test_that("a picture is made smaller as a whole", {
  skip_if_not_installed("magick")
  skip_if_not_installed("png")
  read <- read_gif(list(dotted(1, 1), dotted(5, 5)), width = 4)
  expect_identical(unique(magick::image_info(read)[c("width", "height")])$width, 4L)
  expect_identical(unique(magick::image_info(read)$height), 3L)
})

test_that("grey and half transparent pictures stand on white", {
  skip_if_not_installed("magick")
  skip_if_not_installed("png")
  grey <- png::writePNG(matrix(0.2, 2, 2))
  expect_identical(unique(pixels_of(read_gif(list(grey)))), 51L)
  glass <- png::writePNG(array(rep(c(0, 0, 0, 0), each = 4), c(2, 2, 4)))
  expect_identical(unique(pixels_of(read_gif(list(glass)))), 255L)
})

test_that("more colours than the format has are made fewer", {
  skip_if_not_installed("magick")
  skip_if_not_installed("png")
  many <- array(seq(0, 1, length.out = 40 * 40 * 3), c(40, 40, 3))
  read <- read_gif(list(png::writePNG(many), png::writePNG(many[40:1, , ])))
  expect_length(read, 2)
  off <- abs(pixels_of(magick::image_coalesce(read)[2]) -
               pixels_of(magick::image_read(png::writePNG(many[40:1, , ]))))
  expect_lt(mean(off), 10)
})

test_that("only what differs counts as changed", {
  before <- array(as.raw(0), c(3, 8, 6))
  now <- before
  now[2, 3, 2] <- as.raw(1)
  now[1, 5, 4] <- as.raw(1)
  expect_identical(changed_part(before, now), list(x = 2L, y = 1L, width = 3L, height = 3L))
  expect_identical(changed_part(before, before), list(x = 0L, y = 0L, width = 1L, height = 1L))
  expect_identical(changed_part(NULL, now), list(x = 0L, y = 0L, width = 8L, height = 6L))
})
