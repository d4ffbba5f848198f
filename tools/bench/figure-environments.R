# Whole episodes by rollout() against Python's own loop, environment by environment, and what a step
# takes beside the bare exchange of its bytes.

draw_environments <- function(rows, run, file) {
  grDevices::png(file, width = 1900, height = 1050, res = 170)
  on.exit(grDevices::dev.off())
  graphics::layout(matrix(1:2, 1L), widths = c(1.5, 1))
  draw_rollouts(rows)
  draw_steps(rows)
  turns <- max(rows$turn[rows$part == "env_rollouts"])
  graphics::mtext(
    sprintf("medians and ranges of the paired ratios of %.0f turns, %s", turns, run[["date"]]),
    side = 1L, outer = TRUE, line = -1, adj = 0.99, cex = 0.65, col = "grey40"
  )
}

gym_colour <- "#D55E00"
reticulate_colour <- "#0072B2"

# The ratios of one line of the left panel: of gym, and of reticulate where it plays.
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
                        0.8))
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
  graphics::title("rollout() by id, a linear policy, two cores", line = 2.6, adj = 0)
  draw_key(c("gym, over HTTP", "reticulate in process", "goal"),
           c(gym_colour, reticulate_colour, "grey50"), c(16L, 15L, 124L))
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

draw_key <- function(labels, colours, shapes) {
  corner <- graphics::par("usr")
  graphics::legend(
    10^corner[1L], corner[4L], labels, col = colours, pch = shapes, bty = "n", cex = 0.8,
    horiz = TRUE, xpd = NA, yjust = 0.1, pt.cex = 1.2, x.intersp = 0.7
  )
}

draw_steps <- function(rows) {
  steps <- rows[rows$part == "wire", ]
  sizes <- sort(unique(steps$num_envs))
  heights <- rev(seq_along(sizes))
  took <- function(name, num_envs) values_of(rows, "wire", wire_names[[name]], num_envs)
  medians <- vapply(split(steps$value, paste(steps$contender, steps$num_envs)), stats::median, 0)
  graphics::par(mar = c(5.5, 6, 4, 1))
  graphics::plot(NA, log = "x", xlim = range(medians) * c(0.85, 1.2),
                 ylim = c(0.5, length(sizes) + 0.5), xlab = "microseconds", ylab = "",
                 axes = FALSE)
  labels <- ifelse(sizes == 0, "single", paste0(format(sizes, big.mark = ",", trim = TRUE),
                                                "\nsub-envs"))
  draw_scale(heights, labels, range(medians) * c(0.85, 1.2))
  names <- c(bare = "black", parsed = "grey50", gym = gym_colour, isolated = "#CC79A7")
  for (i in seq_along(sizes)) {
    for (name in names(names)) {
      values <- took(name, sizes[i])
      draw_point(values, heights[i], names[[name]])
    }
    graphics::segments(stats::median(took("bare", sizes[i])), heights[i],
                       stats::median(took("gym", sizes[i])), heights[i], col = gym_colour)
  }
  graphics::title("one step of CartPole-v1", line = 2.6, adj = 0)
  draw_key(c("bytes only", "and parsed", "env$step()", "isolated"), names, 16L)
}

draw_point <- function(values, height, colour) {
  if (length(values)) {
    graphics::points(stats::median(values), height, pch = 16L, col = colour, cex = 1.4)
  }
}
