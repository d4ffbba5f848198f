# What all plots use.

# An empty plot with this package's defaults, which the caller's arguments override.
open_plot <- function(frame, chosen) {
  las <- number_direction(pretty(frame$y))
  frame <- c(frame, list(type = "n", las = las, bty = "l"))
  do.call(graphics::plot, c(chosen, frame[setdiff(names(frame), names(chosen))]))
}

# Upright numbers read best, but long ones would run into the axis's label.
number_direction <- function(at) if (max(nchar(at)) > 3L) 0L else 1L

# A title that names the environment and the policy.
played_title <- function(x) {
  paste(c(x$env_id, paste("policy:", policy_label(x$policy))), collapse = ", ")
}

# Rounds are whole numbers from 1, and so are the marks on their axis.
round_ticks <- function(last) {
  at <- unique(round(pretty(c(1, last))))
  at[at >= 1 & at <= last]
}

# Colours that remain apart for the colour-blind (Okabe and Ito, 2008).
okabe_ito <- list(
  orange = "#E69F00", sky_blue = "#56B4E9", green = "#009E73", yellow = "#F0E442",
  blue = "#0072B2", vermillion = "#D55E00", purple = "#CC79A7"
)

# Colours in plots of trajectories: of the limits of an episode, its end, and lines that share a
# panel.
limit_colours <- c(failure = okabe_ito$vermillion, goal = okabe_ito$green)
ending_colours <- c(terminated = okabe_ito$vermillion, truncated = "grey50")
line_colours <- unlist(okabe_ito[c("blue", "orange", "green", "purple", "sky_blue", "vermillion")],
                       use.names = FALSE)

# Fills the plot with a field of colours, and draws the lines of levels where there are any.
draw_field <- function(data) {
  graphics::image(data$x, data$y, data$z, zlim = data$zlim, col = data$palette, add = TRUE,
                  useRaster = TRUE)
  within <- range(data$z, na.rm = TRUE)
  border <- data$border[data$border > within[[1L]] & data$border < within[[2L]]]
  if (length(border)) {
    graphics::contour(data$x, data$y, data$z, levels = border, add = TRUE, lwd = 2,
                      drawlabels = FALSE)
  }
}

# A legend in one line above the plot, where there are no data; smaller where the plot is narrow.
# (graphics::legend() gives each entry the width of the longest.) It is laid out in inches, so that
# logarithmic axes do not matter.
legend_above <- function(labels, col, pch, lty, cex = 0.9) {
  width <- function(cex) sum(legend_widths(labels, cex)) - legend_gap(cex)
  sides <- graphics::grconvertX(0:1, "npc", "inches")
  # The ratio of the widths does not give the size, because devices round the sizes of letters.
  while (width(cex) > diff(sides) && cex > 0.3) cex <- 0.95 * cex
  starts <- mean(sides) - width(cex) / 2 + cumsum(c(0, legend_widths(labels, cex)))
  left <- starts[seq_along(labels)]
  key <- legend_key(cex)
  height <- graphics::grconvertY(1, "npc", "inches") + 0.9 * graphics::par("csi")
  x <- function(inches) graphics::grconvertX(inches, "inches", "user")
  y <- rep(graphics::grconvertY(height, "inches", "user"), length(labels))
  lined <- !is.na(lty)
  graphics::segments(x(left), y, x(left + key), y, xpd = NA,
                     col = ifelse(lined, col, NA), lty = ifelse(lined, lty, "blank"), lwd = 2)
  graphics::points(x(left + key / 2), y, xpd = NA, pch = pch, col = col, cex = cex)
  graphics::text(x(left + 1.2 * key), y, labels, xpd = NA, cex = cex, adj = c(0, 0.4))
  place <- list(left = starts[[1L]], right = starts[[1L]] + width(cex), height = height)
  invisible(place)
}

legend_widths <- function(labels, cex) {
  1.2 * legend_key(cex) + graphics::strwidth(labels, "inches", cex = cex) + legend_gap(cex)
}

legend_key <- function(cex) graphics::strwidth("MM", "inches", cex = cex)

legend_gap <- legend_key
