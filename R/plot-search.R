#' Plot a search
#'
#' Shows how a search went: every episode as a point, the mean of each round as a
#' line, the target as a dashed line. Episodes of a round that have almost the same
#' return are set side by side.
#'
#' With another `type` it shows the network that was found, or plays the networks around it
#' and shows their landscape, which takes some seconds.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object A search, as [search_random()] returns it.
#' @param type What to show: `"returns"`, the default; `"network"`, the best policy, as
#'   [plot.gym_policy_network()]; or `"landscape"`, which plays [search_landscape()].
#' @param main The title; the default describes what was searched and what came of it.
#' @param xlab,ylab The axes' labels.
#' @param ... For the returns further arguments of [plot()][graphics::plot.default()], such as
#'   `ylim`; for the others the arguments of these functions and their plots, such as
#'   `size` and `seed` of the landscape.
#' @return `x`, invisibly; for a landscape what [search_landscape()] returns, invisibly, so
#'   that it need not be played again; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when no round was played to its end.
#' @export
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search)
#' plot(search, type = "network")
plot.gym_search <- function(x, type = c("returns", "network", "landscape"), main = NULL,
                            xlab = "round", ylab = "return (reward summed over an episode)", ...) {
  type <- check_choice(type[1L], c("returns", "network", "landscape"), arg = "type")
  if (type == "network") {
    check_found(x)
    plot(x$policy, main = main, ...)
    return(invisible(x))
  }
  if (type == "landscape") {
    return(plot_landscape(x, main = main, ...))
  }
  main <- main %||% search_title(x)
  data <- search_plot_data(x)
  open_plot(list(x = data$xlim, y = data$ylim, xlab = xlab, ylab = ylab, xaxt = "n"), list(...))
  graphics::axis(1L, at = round_ticks(max(data$means$round)))
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
  outcome <- if (x$solved) {
    paste(": solved in round", x$round)
  } else if (!is.null(x$target)) {
    paste(": not solved in", count_of(nrow(x$rounds), "round"))
  }
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

# Offsets that put returns of one round which are closer than `near` side by side. They are not
# drawn at random, because a plot leaves R's generator alone.
spread <- function(round, value, near) {
  bin <- if (near > 0) round(value / near) else value * 0
  group <- interaction(round, bin, drop = TRUE)
  place <- stats::ave(value, group, FUN = seq_along)
  size <- stats::ave(value, group, FUN = length)
  0.6 * (place - (size + 1) / 2) / max(size, 5)
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

#' @rdname plot.gym_search
#' @exportS3Method ggplot2::autoplot
autoplot.gym_search <- function(object, type = c("returns", "network", "landscape"), ...) {
  type <- check_choice(type[1L], c("returns", "network", "landscape"), arg = "type")
  if (type == "network") {
    check_found(object)
    return(autoplot.gym_policy_network(object$policy, ...))
  }
  if (type == "landscape") {
    return(autoplot.gym_landscape(search_landscape(object, ...)))
  }
  data <- search_plot_data(object)
  plot <- ggplot2::ggplot(data$points, ggplot2::aes(.data$x, .data$return)) +
    ggplot2::geom_point(colour = okabe_ito$sky_blue, alpha = 0.8) +
    ggplot2::geom_line(ggplot2::aes(.data$round, .data$mean_return), data$means,
                       colour = okabe_ito$blue, linewidth = 0.8) +
    ggplot2::geom_point(ggplot2::aes(.data$round, .data$mean_return), data$means,
                        colour = okabe_ito$blue, shape = 15) +
    ggplot2::scale_x_continuous(breaks = round_ticks(max(data$means$round))) +
    ggplot2::labs(title = search_title(object), x = "round",
                  y = "return (reward summed over an episode)",
                  subtitle = "points: episodes; line: mean of the round; dashed: target")
  if (is.null(data$target)) {
    plot
  } else {
    plot + ggplot2::geom_hline(yintercept = data$target, colour = okabe_ito$vermillion,
                               linetype = "dashed", linewidth = 0.8)
  }
}
