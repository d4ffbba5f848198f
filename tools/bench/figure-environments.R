# Draws two comparisons: whole episodes by rollout() with Python's own loop, for each environment,
# and the time of a step with that of the bare exchange of its bytes.

draw_environments <- function(rows, run, file) {
  grDevices::png(file, width = 1330, height = 735, res = 119)
  on.exit(grDevices::dev.off())
  graphics::layout(matrix(1:2, 1L), widths = c(1.5, 1))
  draw_rollouts(rows)
  draw_steps(rows)
  turns <- max(rows$turn[rows$part == "env_rollouts"])
  graphics::mtext(
    sprintf("medians and ranges of %.0f turns' ratios, %s", turns, run[["date"]]),
    side = 1L, outer = TRUE, line = -1, adj = 0.99, cex = 0.65, col = "grey40"
  )
}

gym_colour <- "#D55E00"
reticulate_colour <- "#0072B2"

# The ratios of one line of the left panel: of gym, and of reticulate if it plays.
rollout_line <- function(rows, label, part, env_id, goal) {
  of <- function(name) values_of(rows, part, name, env_id = env_id)
  python <- of("Python")
  plays <- length(of(reticulates(rows)[1L])) > 0L
  list(
    label = label, goal = goal, gym = of(rollout_names[["gym"]]) / python,
    reticulate = if (plays) faster_reticulate(rows, env_id) / python
  )
}

rollout_lines <- function(rows) {
  played <- tasks[intersect(names(tasks), rows$env_id[rows$part == "env_rollouts"])]
  c(
    lapply(unname(played), function(task) {
      rollout_line(rows, task$env_id, "env_rollouts", task$env_id, task$goal)
    }),
    if ("candidates" %in% rows$part) {
      list(rollout_line(rows, "LunarLander-v3,\n16 candidates", "candidates", "LunarLander-v3",
                        1.2))
    }
  )
}

draw_rollouts <- function(rows) {
  lines <- rollout_lines(rows)
  heights <- rev(seq_along(lines))
  ratios <- unlist(lapply(lines, `[`, c("gym", "reticulate", "goal")))
  graphics::par(mar = c(5.5, 8, 4, 1), las = 1, mgp = c(2.2, 0.7, 0))
  graphics::plot(NA, log = "x", xlim = range(ratios, 1), ylim = c(0.5, length(lines) + 0.5),
                 xlab = "times as many steps a second as Python's own loop", ylab = "",
                 axes = FALSE)
  draw_scale(heights, vapply(lines, function(line) line$label, ""), ratios)
  graphics::abline(v = 1, lwd = 1.5)
  for (i in seq_along(lines)) {
    line <- lines[[i]]
    graphics::segments(line$goal, heights[i] - 0.32, line$goal, heights[i] + 0.32, lwd = 2,
                       col = "grey50")
    draw_spread(line$reticulate, heights[i] - 0.12, reticulate_colour, 15L)
    draw_spread(line$gym, heights[i] + 0.12, gym_colour, 16L)
  }
  cores <- sub(".*, ([0-9]+) cores$", "\\1", rows$called[rows$part == "env_rollouts"][1L])
  graphics::title(sprintf("rollout() by id, a linear policy, %s cores", cores), line = 2.6, adj = 0)
  corner <- graphics::par("usr")
  graphics::legend(
    10^corner[1L], corner[4L], c("gym, over HTTP", "reticulate in process", "goal"),
    col = c(gym_colour, reticulate_colour, "grey50"), pch = c(16L, 15L, 124L), bty = "n",
    cex = 0.8, horiz = TRUE, xpd = NA, yjust = 0.1, pt.cex = 1.2
  )
}

# The median as a point, the range as a line.
draw_spread <- function(values, height, colour, shape) {
  if (length(values)) {
    graphics::segments(min(values), height, max(values), height, col = colour, lwd = 2)
    graphics::points(stats::median(values), height, pch = shape, col = colour, cex = 1.3)
  }
}

draw_scale <- function(heights, labels, values) {
  graphics::box(col = "grey60")
  ticks <- c(outer(c(1, 2, 5), 10^(-4:5)))
  ticks <- ticks[ticks >= min(values) & ticks <= max(values)]
  graphics::abline(v = ticks, col = "grey92")
  graphics::abline(h = heights, col = "grey96")
  graphics::axis(1L, ticks, format(ticks, big.mark = ",", drop0trailing = TRUE, trim = TRUE,
                                   scientific = FALSE), cex.axis = 0.8)
  graphics::axis(2L, heights, labels, cex.axis = 0.8, tick = FALSE)
}

# How the contenders for a step are drawn, by their names in wire_names.
step_styles <- data.frame(
  name = c("bare", "parsed", "gym"),
  label = c("the same bytes", "and read", "env$step()"),
  colour = c("black", "grey50", gym_colour)
)

draw_steps <- function(rows) {
  sizes <- sort(unique(rows$num_envs[rows$part == "wire"]))
  heights <- rev(seq_along(sizes))
  took <- function(name, num_envs) {
    stats::median(values_of(rows, "wire", wire_names[[name]], num_envs))
  }
  medians <- outer(step_styles$name, sizes, Vectorize(took))
  limits <- range(medians, na.rm = TRUE) * c(0.85, 1.2)
  graphics::par(mar = c(5.5, 4, 4, 1))
  graphics::plot(NA, log = "x", xlim = limits, ylim = c(0.5, length(sizes) + 0.8),
                 xlab = "microseconds", ylab = "", axes = FALSE)
  labels <- ifelse(sizes == 0, "single", format(sizes, big.mark = ",", trim = TRUE))
  draw_scale(heights, labels, limits)
  graphics::segments(medians[1L, ], heights, medians[3L, ], heights, col = gym_colour)
  for (i in seq_along(sizes)) {
    graphics::points(medians[, i], rep(heights[i], nrow(medians)), pch = 16L, cex = 1.4,
                     col = step_styles$colour)
  }
  graphics::title("a step of CartPole-v1", line = 2.6, adj = 0)
  graphics::mtext("num_envs", adj = -0.15, line = 0.5, cex = 0.8)
  graphics::legend("topright", step_styles$label, col = step_styles$colour, pch = 16L,
                   bty = "n", cex = 0.8, pt.cex = 1.2)
}
