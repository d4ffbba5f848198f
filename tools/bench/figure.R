# Draws steps a second by the number of sub-environments: the contenders, the limit, and single
# environments.

# Okabe and Ito's colours, and how each contender is drawn.
figure_styles <- function(reticulates) {
  data.frame(
    name = c(own[["vector"]], "Python", reticulates),
    label = c("gym, over HTTP", "Python in process (the limit)",
              sub(",", " in process,", reticulates)),
    colour = c("#D55E00", "#000000", "#0072B2", "#56B4E9")[seq_len(2L + length(reticulates))],
    shape = c(16L, 4L, 15L, 17L)[seq_len(2L + length(reticulates))],
    width = c(3, 1.5, 1.5, 1.5)[seq_len(2L + length(reticulates))]
  )
}

draw_figure <- function(rows, run, file) {
  summary <- summarise(rows)
  curves <- summary[summary$part == "vector", ]
  single <- summary[summary$part == "single", ]
  styles <- figure_styles(reticulates(rows))
  grDevices::png(file, width = 1050, height = 735, res = 133)
  on.exit(grDevices::dev.off())
  graphics::par(mar = c(4, 5.5, 2.5, 1), las = 1, mgp = c(3.2, 0.7, 0))
  sizes <- sort(unique(curves$num_envs))
  # Points of single environments are to the left of one sub-environment.
  single_at <- 0.3
  graphics::plot(
    NA, log = "xy", xlim = c(single_at, max(sizes)), ylim = range(summary_range(curves, single)),
    xlab = "", ylab = "", axes = FALSE
  )
  draw_axes(sizes, single_at, range(summary_range(curves, single)))
  constant_line(single, single_at * 1.2, "Python", "a loop in Python")
  constant_line(single, single_at * 1.2, "classic pattern",
                "classic pattern: httr, development server")
  for (i in rev(seq_len(nrow(styles)))) {
    draw_contender(styles[i, ], curves, single, single_at)
  }
  graphics::legend(
    "topleft", styles$label, col = styles$colour, pch = styles$shape, lwd = styles$width,
    bty = "n", cex = 0.85, inset = 0.01
  )
  graphics::title("CartPole-v1 from R: env steps a second", line = 1, adj = 0)
  graphics::title(xlab = "num_envs", line = 2)
  graphics::mtext(figure_note(rows, run), side = 1L, adj = 1, cex = 0.7, line = 3,
                  col = "grey40")
}

figure_note <- function(rows, run) {
  sprintf("medians and ranges of %.0f turns, %s cores, %s", max(rows$turn[rows$part == "vector"]),
          run[["cores"]], run[["date"]])
}

summary_range <- function(...) {
  all <- rbind(...)
  c(all$low, all$high)
}

draw_axes <- function(sizes, single_at, range) {
  graphics::box(col = "grey60")
  graphics::axis(1L, c(single_at, sizes), c("single", sizes), cex.axis = 0.85, gap.axis = 0)
  powers <- 10^seq(floor(log10(range[1L])), ceiling(log10(range[2L])))
  graphics::axis(2L, powers, format(powers, big.mark = ",", scientific = FALSE, trim = TRUE),
                 cex.axis = 0.85)
  graphics::abline(h = powers, col = "grey92")
}

constant_line <- function(single, left, name, label) {
  height <- single$median[single$contender == name]
  if (length(height)) {
    graphics::abline(h = height, lty = "dashed", col = "grey50")
    graphics::text(left, height, label, adj = c(0, -0.5), cex = 0.75, col = "grey30")
  }
}

# A line through the medians with the ranges as bars, and the point of a single environment.
draw_contender <- function(style, curves, single, single_at) {
  curve <- curves[curves$contender == style$name, ]
  alone <- single[single$contender == style$name, ]
  graphics::lines(curve$num_envs, curve$median, col = style$colour, lwd = style$width)
  points <- rbind(
    data.frame(x = curve$num_envs, curve[c("median", "low", "high")]),
    data.frame(x = rep(single_at, nrow(alone)), alone[c("median", "low", "high")])
  )
  graphics::segments(points$x, points$low, points$x, points$high, col = style$colour)
  graphics::points(points$x, points$median, pch = style$shape, col = style$colour)
}
