# For tests of plots: a device that keeps nothing, and what a plot must leave as it was.

local_device <- function(width = 7, height = 5, frame = parent.frame()) {
  grDevices::pdf(NULL, width = width, height = height)
  withr::defer(grDevices::dev.off(), envir = frame)
}

# What plots may have changed, and must have put back.
plot_parameters <- function() {
  graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd", "tcl"))
}

expect_leaves_session_alone <- function(code) {
  graphics::plot.new()
  before <- plot_parameters()
  state <- globalenv()$.Random.seed
  force(code)
  testthat::expect_identical(plot_parameters(), before)
  testthat::expect_identical(globalenv()$.Random.seed, state)
}
