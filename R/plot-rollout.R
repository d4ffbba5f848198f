#' Plot a rollout
#'
#' Shows how the returns of a rollout's episodes are distributed: their density, the
#' median marked, and each episode as a tick on the axis. When all episodes have the
#' same return there is no density, and the mark stands alone.
#'
#' @param x What [rollout()] returned.
#' @param main The title; the default tells the environment and the policy.
#' @param xlab,ylab The axes' labels.
#' @param ... Further arguments of [plot()][graphics::plot.default()], such as `xlim`.
#' @return `x`, invisibly.
#' @references The density is that of [stats::density()] with its default bandwidth, within
#'   the range of the returns, as in the figure of the post "Artificial Intelligence in R (I)".
#' @export
#' @examplesIf gym:::can_start_server()
#' plot(rollout("CartPole-v1", policy_random(), episodes = 50, seed = 1))
plot.gym_rollout <- function(x, main = rollout_title(x),
                             xlab = "return (reward summed over an episode)",
                             ylab = "density", ...) {
  data <- rollout_plot_data(x)
  flat <- is.null(data$density)
  open_plot(
    list(x = data$xlim, y = data$ylim, main = main, xlab = xlab,
         ylab = if (flat) "" else ylab, yaxs = "i", yaxt = if (flat) "n" else "s"),
    list(...)
  )
  if (!flat) {
    draw_density(data$density)
  }
  graphics::rug(data$returns, col = okabe_ito$blue, quiet = TRUE)
  draw_median(data)
  invisible(x)
}

rollout_title <- function(x) {
  # Up to the first detail: "random" or "network 4-2-1".
  paste0(x$env_id, ", policy: ", sub("(,| over).*", "", policy_text(x$policy)))
}

#' Compute what a plot of a rollout shows
#' @return A list: `returns`, `median`, `density` (data frame `x`, `y`, `NULL` when all
#'   returns are equal), `xlim`, `ylim`.
#' @noRd
rollout_plot_data <- function(x) {
  returns <- x$episodes$return
  from <- min(returns)
  to <- max(returns)
  if (from < to) {
    estimate <- stats::density(returns, from = from, to = to)
    density <- data.frame(x = estimate$x, y = estimate$y)
  } else {
    density <- NULL
  }
  list(
    returns = returns,
    median = stats::median(returns),
    density = density,
    xlim = if (is.null(density)) from + c(-1, 1) * max(1, abs(from) / 10) else c(from, to),
    # Room for the median's label above the curve.
    ylim = c(0, if (is.null(density)) 1 else 1.15 * max(density$y))
  )
}

draw_density <- function(density) {
  graphics::polygon(
    c(density$x[[1L]], density$x, density$x[[nrow(density)]]), c(0, density$y, 0),
    border = NA, col = grDevices::adjustcolor(okabe_ito$sky_blue, 0.4)
  )
  graphics::lines(density$x, density$y, col = okabe_ito$blue, lwd = 2)
}

draw_median <- function(data) {
  top <- data$ylim[[2L]]
  graphics::segments(
    data$median, 0, data$median, 0.92 * top, col = okabe_ito$vermillion, lwd = 2, lty = "dashed"
  )
  label <- paste0("median ", number_text(data$median), " (n = ", length(data$returns), ")")
  # Centred in the middle of the plot, the nearer a side the further towards the middle.
  place <- (data$median - data$xlim[[1L]]) / diff(data$xlim)
  graphics::text(data$median, 0.96 * top, label, adj = c(place, 0.5), xpd = NA,
                 col = okabe_ito$vermillion)
}
