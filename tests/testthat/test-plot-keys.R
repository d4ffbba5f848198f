test_that("the bar of colours fits a narrow plot", {
  local_device()
  graphics::par(mfrow = c(1, 3))
  graphics::plot(1)
  sides <- graphics::grconvertX(0:1, "npc", "inches")
  key <- list(palette = c("red", "blue"), ends = c("0.1", "200"), label = "output")
  placed <- colour_key_above(key)
  expect_gte(placed$left, sides[1] - 1e-9)
  expect_lte(placed$right, sides[2] + 1e-9)
  expect_null(colour_key_above(NULL))
})

test_that("titles and remarks may be missing or long", {
  local_device(3, 3)
  graphics::plot(1)
  expect_silent(title_above(NULL))
  expect_silent(title_above(strrep("long ", 40)))
  expect_silent(corner_text(NULL))
  graphics::par(mfrow = c(2, 3))
  for (panel in 1:6) {
    graphics::plot(1)
    expect_silent(title_above("a title of some length"))
  }
  expect_silent(corner_text(c("one", strrep("long ", 40))))
})
