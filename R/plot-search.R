#' Plot a search
#'
#' Shows how a search went: every episode as a point, the mean of each round as a
#' line, the target as a dashed line. Episodes of a round that have almost the same
#' return are set side by side.
#'
#' @param x A search, as [search_random()] returns it.
#' @param main The title; the default says what was searched and what came of it.
#' @param xlab,ylab The axes' labels.
#' @param ... Further arguments of [plot()][graphics::plot.default()], such as `ylim`.
#' @return `x`, invisibly.
#' @section Errors: `gym_error_argument` when no round was played to its end.
#' @export
#' @examplesIf gym:::can_start_server()
#' plot(search_random("CartPole-v0", seed = 1))
plot.gym_search <- function(x, main = search_title(x), xlab = "round",
                            ylab = "return (reward summed over an episode)", ...) {
  data <- search_plot_data(x)
  open_plot(list(x = data$xlim, y = data$ylim, xlab = xlab, ylab = ylab, xaxt = "n"), list(...))
  round_axis(data$means$round)
  if (!is.null(data$target)) {
    graphics::abline(h = data$target, col = okabe_ito$vermillion, lty = "dashed", lwd = 2)
  }
  graphics::points(data$points$x, data$points$return, pch = 16L, cex = 0.8,
                   col = grDevices::adjustcolor(okabe_ito$sky_blue, 0.8))
  graphics::lines(data$means$round, data$means$mean_return, col = okabe_ito$blue, lwd = 2)
  graphics::points(data$means$round, data$means$mean_return, col = okabe_ito$blue, pch = 15L,
                   cex = 0.7)
  graphics::title(main = main, line = 2.5)
  search_legend(data)
  invisible(x)
}

search_title <- function(x) {
  outcome <- if (x$solved) paste(": solved in round", x$round)
  paste0("Random search in ", x$env_id, outcome)
}

#' Compute what a plot of a search shows
#' @return A list: `points` (data frame: `round`, `return`, `x`, the place on the axis),
#'   `means` (data frame: `round`, `mean_return`), `target` (`NULL` when there is none to
#'   show), `xlim`, `ylim`.
#' @noRd
search_plot_data <- function(x, call = rlang::caller_env()) {
  if (nrow(x$rounds) == 0L) {
    gym_abort(
      "There is nothing to plot: the search ended before its first round was played to its end.",
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  target <- if (!is.null(x$target) && is.finite(x$target)) x$target
  ylim <- range(x$episodes$return, target)
  points <- x$episodes[c("round", "return")]
  points$x <- points$round + spread(points$round, points$return, diff(ylim) / 50)
  list(
    points = points,
    means = x$rounds[c("round", "mean_return")],
    target = target,
    xlim = c(0.5, max(x$rounds$round) + 0.5),
    ylim = ylim
  )
}

# Offsets that put returns of one round which are closer than `near` side by side.
# Not drawn at random: a plot leaves R's generator alone.
spread <- function(round, value, near) {
  bin <- if (near > 0) round(value / near) else value * 0
  group <- interaction(round, bin, drop = TRUE)
  place <- stats::ave(value, group, FUN = seq_along)
  size <- stats::ave(value, group, FUN = length)
  0.6 * (place - (size + 1) / 2) / max(size, 5)
}

# Rounds are whole numbers, and so are the marks on their axis.
round_axis <- function(rounds) {
  at <- unique(round(pretty(c(1, max(rounds)))))
  graphics::axis(1L, at = at[at >= 1 & at <= max(rounds)])
}

search_legend <- function(data) {
  shown <- c(TRUE, TRUE, !is.null(data$target))
  legend_above(
    labels = c("episode", "mean of the round", paste("target", number_text(data$target)))[shown],
    col = c(okabe_ito$sky_blue, okabe_ito$blue, okabe_ito$vermillion)[shown],
    pch = c(16L, 15L, NA)[shown],
    lty = c(NA, "solid", "dashed")[shown]
  )
}
