#' Plot a rollout, or compare several
#'
#' Three pictures of a rollout: of all of its episodes how their returns are distributed, and
#' of one of them what was observed and done, or how it looked. Several rollouts, or one of several
#' policies, are compared: a row for each policy shows how its returns are distributed.
#'
#' `"returns"` shows the density of the episodes' returns, the median marked, and each episode
#' as a tick on the axis. Where there are few different returns, such as the 0 and 1 of
#' FrozenLake, it shows a bar for each, as high as the number of its episodes: where there are
#' at most 3, or at most 10 that come twice on average. In a comparison each row is as high as the
#' others, whatever the numbers of episodes; of more than ten policies it shows those with the ten
#' highest mean returns.
#'
#' `"trajectory"` shows an episode's observations, each in a panel of its own, and below them its
#' actions, against the number of steps taken. Where Gymnasium's documentation has units and what
#' actions mean, the labels do, too. Dashed lines are limits at which the documentation says that
#' an episode ends (in CartPole the cart beyond 2.4 m, the pole beyond 12 degrees), drawn where
#' the episode comes near; a solid line is its end. The observations are those that the actions were
#' taken on: the one after the last step is not among them. Takes a rollout with `steps = TRUE`.
#' Where a wrapper changes what is observed, as `NormalizeObservation` does, the labels are `obs_1`
#' and so on, and there are no limits.
#'
#' `"filmstrip"` shows frames of an episode side by side, in rows where that makes them
#' larger, evenly apart, the first and the last among them. Above and below, what is blank in all
#' of them is cut off. Takes a rollout with `frames = TRUE`, and the package png.
#'
#' @param x What [rollout()] returned. It may have another name, which is then that of its row:
#'   `plot(random = played_1, network = played_2)`.
#' @param type `"returns"`, the default, `"trajectory"` or `"filmstrip"`.
#' @param main The title; `NULL`, the default, names the environment and the policy, in a
#'   filmstrip nothing.
#' @param xlab,ylab The axes' labels, for `"returns"`.
#' @param episode Which episode to show, a whole number; the default is the first.
#' @param variables The parts of the observation to show in a trajectory: names of columns of the
#'   table of steps, such as `"pole_angle"`, also `"reward"`. `NULL`, the default, takes the
#'   first 8.
#' @param n How many frames a filmstrip has at most, a whole number; the default is 8.
#' @param candidate Whose episode to show where several policies were played, a whole number; the
#'   default is the first.
#' @param ... For `"returns"` further rollouts to compare, with the names of their rows or without,
#'   and further arguments of [plot()][graphics::plot.default()], such as `xlim`; the other types
#'   take none.
#' @return `x`, or the first rollout, invisibly.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, and for a
#'   rollout that was played without the steps or frames that are to be shown.
#' @references The density is that of [stats::density()] with its default bandwidth, within
#'   the range of the returns, as in the figure of the tutorial *Artificial Intelligence in R (I)*
#'   (2018).
#' @seealso [animate()] for a moving picture.
#' @export
#' @examplesIf gym:::can_start_server()
#' plot(rollout("CartPole-v1", policy_random(), episodes = 50, seed = 1))
#'
#' # The pole falls to the right: push the cart to the right.
#' follow_pole <- function(observation) as.integer(observation[, "pole_angle"] > 0)
#' random <- rollout("CartPole-v1", policy_random(), episodes = 50, seed = 1)
#' follow <- rollout("CartPole-v1", follow_pole, episodes = 50, seed = 1)
#' plot(random = random, `follow the pole` = follow)
#' policies <- list(random = policy_random(), follow = follow_pole)
#' plot(rollout("CartPole-v1", policies, episodes = 50, seed = 1))
#'
#' played <- rollout("CartPole-v1", follow_pole, seed = 1, steps = TRUE, frames = TRUE)
#' plot(played, type = "trajectory")
#' if (requireNamespace("png", quietly = TRUE)) plot(played, type = "filmstrip")
plot.gym_rollout <- function(x, ..., type = c("returns", "trajectory", "filmstrip"), main = NULL,
                             xlab = NULL, ylab = NULL, episode = 1, variables = NULL, n = 8,
                             candidate = 1) {
  type <- check_choice(type[1L], c("returns", "trajectory", "filmstrip"), arg = "type")
  # Without `x` the first rollout has the name of its row.
  given <- if (missing(x)) {
    given_rollouts(list(...), substitute(list(...)))
  } else {
    given_rollouts(list(x, ...), substitute(list(x, ...)))
  }
  rollouts <- given$rollouts
  x <- rollouts[[1L]]
  if (type != "returns") {
    check_single_rollout(rollouts, type)
    rlang::exec(check_dots_empty, !!!given$others)
  }
  switch(type,
    returns = if (is_comparison(rollouts)) {
      plot_comparison(rollouts, main, xlab, ylab, given$others)
    } else {
      plot_returns(x, main, xlab, ylab, given$others)
    },
    trajectory = plot_trajectory(x, episode, variables, main, candidate),
    filmstrip = plot_filmstrip(x, episode, n, main, candidate)
  )
  invisible(x)
}

plot_returns <- function(x, main, xlab, ylab, chosen) {
  data <- returns_plot_data(x$episodes$return)
  bars <- !is.null(data$bars)
  # The axes of bars have marks at their values, and at whole numbers of episodes.
  axes <- if (bars) "n" else "s"
  open_plot(
    list(x = data$xlim, y = data$ylim, main = main %||% played_title(x),
         xlab = xlab %||% returns_label, ylab = ylab %||% returns_measure(data),
         yaxs = "i", xaxt = axes, yaxt = axes),
    chosen
  )
  if (bars) {
    draw_bars(data$bars, own_axes(chosen))
  } else {
    draw_density(data$density)
    graphics::rug(data$returns, col = okabe_ito$blue, quiet = TRUE)
  }
  draw_median(data)
}

returns_label <- "return (reward summed over an episode)"

returns_measure <- function(data) if (is.null(data$bars)) "density" else "episodes"

# With few different returns a density would show values that no episode had, so there are bars.
most_bars <- 10L

#' Compute what a plot of returns shows
#' @return A list: `returns`, `median`, `bars` (data frame `value`, `episodes`, `xmin`, `xmax`,
#'   `NULL` where there are many different returns), `density` (data frame `x`, `y`, `NULL` where
#'   there are bars), `xlim`, `ylim`.
#' @noRd
returns_plot_data <- function(returns) {
  values <- sort(unique(returns))
  few <- length(values) <= min(most_bars, max(3, length(returns) / 2))
  bars <- if (few) return_bars(returns, values)
  density <- if (!few) {
    estimate <- stats::density(returns, from = min(returns), to = max(returns))
    data.frame(x = estimate$x, y = estimate$y)
  }
  list(
    returns = returns,
    median = stats::median(returns),
    bars = bars,
    density = density,
    xlim = if (few) bars_range(bars) else range(returns),
    # Room for the median's label above the curve or the bars.
    ylim = c(0, 1.15 * max(density$y, bars$episodes))
  )
}

# Bars are as wide as the two nearest values allow, and never too narrow to be seen.
return_bars <- function(returns, values) {
  half <- if (length(values) == 1L) {
    0.2 * around(values)
  } else {
    max(0.4 * min(diff(values)), diff(range(values)) / 200)
  }
  data.frame(
    value = values, episodes = tabulate(match(returns, values)), xmin = values - half,
    xmax = values + half
  )
}

bars_range <- function(bars) {
  alone <- nrow(bars) == 1L
  if (alone) bars$value + c(-1, 1) * around(bars$value) else range(bars$xmin, bars$xmax)
}

# How far the axis reaches to either side of a value that stands alone.
around <- function(value) max(1, abs(value) / 10)

draw_bars <- function(bars, axes) {
  graphics::rect(
    bars$xmin, 0, bars$xmax, bars$episodes, border = okabe_ito$blue, lwd = 2,
    col = grDevices::adjustcolor(okabe_ito$sky_blue, 0.4)
  )
  if ("xaxt" %in% axes) {
    at <- bar_marks(bars)
    labels <- if (is.null(at)) TRUE else number_text_each(at)
    graphics::axis(1L, at = at, labels = labels, lwd = 0, lwd.ticks = 1)
  }
  if ("yaxt" %in% axes) {
    at <- unique(round(graphics::axTicks(2L)))
    graphics::axis(2L, at = at, las = number_direction(at))
  }
}

# The axes for which the caller has not given an argument.
own_axes <- function(chosen) {
  if (!"axes" %in% names(chosen)) setdiff(c("xaxt", "yaxt"), names(chosen))
}

# Marks at the values of bars; NULL where two of them are too near for their numbers to fit.
bar_marks <- function(bars) {
  if (nrow(bars) == 1L || min(diff(bars$value)) > diff(range(bars$value)) / 12) bars$value
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
  # In the middle of the plot the label is centred at the median; the nearer to a side the median
  # is, the further the label goes towards the middle.
  place <- (data$median - data$xlim[[1L]]) / diff(data$xlim)
  graphics::text(data$median, 0.96 * top, median_label(data), adj = c(place, 0.5), xpd = NA,
                 col = okabe_ito$vermillion)
}

median_label <- function(data) {
  paste0("median ", number_text(data$median), " (n = ", length(data$returns), ")")
}
