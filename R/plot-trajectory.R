# An episode's observations and actions over its steps, with base graphics.

plot_trajectory <- function(x, episode, variables, main, candidate, call = rlang::caller_env()) {
  data <- trajectory_plot_data(x, episode, variables, candidate, call)
  n <- nrow(data$panels)
  grid <- arrange_panels(n)
  # layout() sets some of these, too, so they are read before it.
  old <- graphics::par("mfrow", "mar", "oma", "mgp", "tcl", "cex", "las", "xpd")
  on.exit({
    graphics::layout(1)
    graphics::par(old)
  })
  # A size of letters that leaves room for the picture on small devices.
  inches <- graphics::par("din") / rev(dim(grid))
  cex <- max(0.4, min(0.85, inches[[1L]] / 2.8, 0.75 * inches[[2L]]))
  graphics::par(cex = cex)
  left <- left_margins(data, grid)
  # So that the plots of all columns are equally wide.
  graphics::layout(grid, widths = (left + 0.8) * line_inches(cex) + plot_width(left, cex))
  graphics::par(cex = cex, oma = c(2.8, 0, 3.2, 0), mgp = c(3, 0.5, 0), tcl = -0.25, las = 1,
                xpd = FALSE)
  title_cex <- panel_title_cex(data$panels$panel, left)
  for (i in seq_len(n)) {
    column <- which(grid == i, arr.ind = TRUE)[1L, 2L]
    graphics::par(mar = c(0.6, left[[column]], 1.6, 0.8))
    draw_panel(data, i, at_bottom = i %in% grid[nrow(grid), ], title_cex)
  }
  title <- main %||% played_title(x)
  graphics::mtext(title, line = 1.6, outer = TRUE, font = 2, cex = 1.1 * cex)
  graphics::mtext(data$subtitle, line = 0.3, outer = TRUE, cex = cex)
  graphics::mtext("steps taken", side = 1L, line = 1.6, outer = TRUE, cex = cex)
}

# Two columns where there are more than two panels; the last panel, of the actions, fills its row.
arrange_panels <- function(n) {
  if (n <= 2L) {
    return(matrix(seq_len(n), ncol = 1L))
  }
  matrix(c(seq_len(n), if (n %% 2L) n), ncol = 2L, byrow = TRUE)
}

# The left margins in lines: room for numbers, and in the column of the actions for their names.
left_margins <- function(data, grid) {
  left <- rep(3.6, ncol(grid))
  line <- line_inches(graphics::par("cex"))
  words <- graphics::strwidth(c(data$choices$label, ""), "inches", cex = 0.9)
  column <- which(grid == nrow(data$panels), arr.ind = TRUE)[1L, 2L]
  left[[column]] <- max(left[[column]], max(words) / line + 1)
  left
}

plot_width <- function(left, cex) {
  margins <- (left + 0.8) * line_inches(cex)
  max(graphics::par("din")[[1L]] - sum(margins), 0.1) / length(left)
}

# The height of a line of the margins, in inches.
line_inches <- function(cex) graphics::par("cin")[[2L]] * cex

# One size of titles for all panels, with which the longest fits. The ratio of the widths does not
# give it, because devices round the sizes of letters.
panel_title_cex <- function(titles, left) {
  room <- plot_width(left, graphics::par("cex"))
  cex <- 1
  while (max(graphics::strwidth(titles, "inches", font = 2, cex = cex)) > room && cex > 0.3) {
    cex <- 0.95 * cex
  }
  cex
}

draw_panel <- function(data, i, at_bottom, title_cex) {
  panel <- data$panels[i, ]
  values <- data$values[data$values$panel == panel$panel, ]
  limits <- data$limits[data$limits$panel == panel$panel, ]
  choice <- panel$kind == "choice"
  at <- near_limits(limits$at, values$value)
  seen <- c(values$value[is.finite(values$value)], at)
  scale <- panel_scale(seen, panel$kind, data$choices)
  graphics::plot.new()
  graphics::plot.window(c(0, data$length), scale$ylim)
  graphics::abline(h = at, col = limit_colours[limits$kind[limits$at %in% at]], lty = "dashed",
                   lwd = 1.5)
  if (choice) {
    draw_choices(values, data$choices)
  } else {
    draw_lines(values, panel$kind)
    graphics::axis(2L, at = scale$ticks, cex.axis = 0.9)
  }
  graphics::abline(v = data$length, col = ending_colours[[data$ending]], lwd = 1.5)
  at <- unique(round(graphics::axTicks(1L)))
  graphics::axis(1L, at = at, labels = at_bottom, cex.axis = 0.9)
  graphics::box(bty = "l")
  parts <- if (!choice) data$actions[intersect(names(data$actions), values$name)]
  draw_panel_title(panel$panel, limits, parts, title_cex)
}

# Which values a panel shows, and where its axis has marks: NULL leaves that to R. A constant
# has a single mark, and whole numbers have whole marks.
panel_scale <- function(seen, kind, choices = NULL) {
  if (kind == "choice") {
    list(ylim = range(choices$value) + c(-0.5, 0.5))
  } else if (length(seen) == 0L) {
    list(ylim = 0:1)
  } else if (length(unique(seen)) == 1L) {
    list(ylim = seen[[1L]] + c(-0.5, 0.5), ticks = seen[[1L]])
  } else {
    list(ylim = range(seen), ticks = if (kind == "stairs") few_breaks(range(seen)))
  }
}

draw_lines <- function(values, kind) {
  names <- unique(values$name)
  for (j in seq_along(names)) {
    one <- values[values$name == names[[j]], ]
    graphics::lines(one$time, one$value, type = if (kind == "stairs") "s" else "l", lwd = 1.5,
                    col = line_colours[[j]])
    if (nrow(one) <= 30L) {
      graphics::points(one$time, one$value, pch = 16L, cex = 0.7, col = line_colours[[j]])
    }
  }
}

# Each action as a box from its step's beginning to its end.
draw_choices <- function(values, choices) {
  graphics::rect(values$time, values$value - 0.35, values$time + 1, values$value + 0.35,
                 col = okabe_ito$blue, border = NA)
  graphics::axis(2L, at = choices$value, labels = choices$label, cex.axis = 0.9, tick = FALSE,
                 gap.axis = 0)
}

# The notes beside the title are left out where they do not fit.
draw_panel_title <- function(title, limits, parts, cex) {
  width <- function(text, ...) graphics::strwidth(text, "inches", cex = cex, ...)
  write <- function(text, ...) {
    graphics::mtext(text, side = 3L, line = 0.25, cex = cex * graphics::par("cex"), ...)
  }
  write(title, adj = 0, font = 2)
  taken <- width(title, font = 2) + width("M")
  note <- unique(limits$text)
  if (length(note) && taken + width(note) < graphics::par("pin")[[1L]]) {
    write(note, adj = 1, col = limit_colours[[limits$kind[[1L]]]])
  }
  if (length(parts) > 1L) {
    starts <- taken + cumsum(c(0, width(paste0(parts, "M"))))[seq_along(parts)]
    left <- graphics::grconvertX(0, "npc", "inches")
    write(parts, at = graphics::grconvertX(left + starts, "inches", "user"), adj = 0,
          col = line_colours[seq_along(parts)])
  }
}
