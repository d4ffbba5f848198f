#' Plot the luck of searches
#'
#' Shows how many rounds searches with different seeds needed, as bars, beside the
#' geometric distribution with the chance of a round, as a line. The bars up to round `mark`
#' stand out, and above the plot is told how many searches are as lucky as that: `mark = 3`,
#' the default, is as many as the tutorial *Artificial Intelligence in R (I)* (2018) needed. The
#' searches that were given up have a bar of their own at the right end.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object Searches, as [search_repeat()] returns them.
#' @param mark Up to which round a search counts as lucky, a whole number of at least 1, or
#'   `NULL` to mark nothing.
#' @param main The title; the default says what was searched and how often.
#' @param xlab,ylab The axes' labels.
#' @param ... Further arguments of [plot()][graphics::plot.default()], such as `xlim`; not
#'   used by `autoplot()`.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when no search was solved.
#' @references The geometric distribution: [stats::dgeom()], counted from the first round.
#' @export
#' @examplesIf gym:::can_start_server()
#' plot(search_repeat("CartPole-v0", seeds = 1:10))
plot.gym_searches <- function(x, mark = 3, main = luck_title(x), xlab = "rounds to solve",
                              ylab = "searches", ...) {
  data <- luck_plot_data(x, mark)
  bars <- data$bars
  open_plot(
    list(x = data$xlim, y = data$ylim, xlab = xlab, ylab = ylab, xaxt = "n", yaxt = "n",
         yaxs = "i"),
    list(...)
  )
  luck_axis(data)
  graphics::rect(bars$x - 0.4, 0, bars$x + 0.4, bars$searches, border = NA,
                 col = ifelse(bars$lucky, okabe_ito$vermillion, okabe_ito$sky_blue))
  curve <- bars[!bars$unsolved, ]
  graphics::lines(curve$x, curve$expected, col = okabe_ito$blue, lwd = 2)
  given_up <- bars[bars$unsolved, ]
  graphics::segments(given_up$x - 0.4, given_up$expected, given_up$x + 0.4, col = okabe_ito$blue,
                     lwd = 2)
  title_above(main)
  legend_above(
    labels = c("searches", data$curve_label), col = c(okabe_ito$sky_blue, okabe_ito$blue),
    pch = c(15L, NA), lty = c(NA, "solid")
  )
  corner_text(data$mark_label, max(curve$x))
  invisible(x)
}

luck_title <- function(x) {
  paste0("Random search in ", x$env_id, ", ", count_of(nrow(x$searches), "seed"))
}

#' Compute what a plot of luck shows
#' @return A list: `bars` (data frame: `round`, `x`, the place on the axis, `searches`, how
#'   many were solved in it, `expected`, how many the geometric distribution gives, `lucky`,
#'   `unsolved`, the latter in the last row, where there is one), `curve_label`,
#'   `mark_label` (`NULL` without a mark), `lucky` (shares of the searches up to the mark:
#'   `expected` and `observed`), `xlim`, `ylim`.
#' @noRd
luck_plot_data <- function(x, mark = 3, call = rlang::caller_env()) {
  check_count(mark, allow_null = TRUE, call = call)
  if (!isTRUE(x$chance > 0)) {
    gym_abort(
      c("There is nothing to plot: no search was solved, so that the chance of a round is unknown.",
        i = "More `rounds` or more `seeds` may help, or a lower `target`."),
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  bars <- luck_bars(x)
  bars$lucky <- !bars$unsolved & bars$round <= (mark %||% 0)
  lucky <- if (!is.null(mark)) {
    list(
      expected = stats::pgeom(mark - 1, x$chance),
      observed = mean(x$searches$solved & x$searches$round <= mark)
    )
  }
  list(
    bars = bars,
    lucky = lucky,
    curve_label = paste0("geometric, chance of a round ", percent_text(x$chance)),
    mark_label = if (!is.null(mark)) luck_label(mark, lucky),
    xlim = c(0.5, max(bars$x) + 0.5),
    ylim = c(0, 1.05 * max(bars$searches, bars$expected))
  )
}

# A row for each round up to the last that solved, and one for the searches given up.
luck_bars <- function(x) {
  n <- nrow(x$searches)
  given_up <- sum(!x$searches$solved)
  last <- if (given_up > 0L) x$max_rounds else max(x$searches$round)
  round <- seq_len(last)
  bars <- data.frame(
    round = round, x = as.numeric(round), searches = tabulate(x$searches$round, last),
    expected = n * stats::dgeom(round - 1, x$chance), unsolved = FALSE
  )
  if (given_up > 0L) {
    bars <- rbind(bars, data.frame(
      round = NA, x = last + max(2, 0.14 * last), searches = given_up,
      expected = n * (1 - x$chance)^last, unsolved = TRUE
    ))
  }
  bars
}

luck_label <- function(mark, lucky) {
  c(
    paste0("Solved ", if (mark == 1) "in the first round:" else paste("within", mark, "rounds:")),
    paste(percent_text(lucky$expected), "by the curve,"),
    paste(percent_text(lucky$observed), "of these searches")
  )
}

luck_axis <- function(data) {
  solved <- data$bars[!data$bars$unsolved, ]
  graphics::axis(1L, at = union(1, round_ticks(max(solved$round))))
  # Searches are whole, too.
  graphics::axis(2L, at = unique(round(pretty(data$ylim))), las = 1L)
  given_up <- data$bars[data$bars$unsolved, ]
  if (nrow(given_up)) {
    graphics::mtext("not\nsolved", 1L, line = 1.5, at = given_up$x,
                    cex = 0.8 * graphics::par("cex"))
  }
}

#' @rdname plot.gym_searches
#' @exportS3Method ggplot2::autoplot
autoplot.gym_searches <- function(object, mark = 3, ...) {
  data <- luck_plot_data(object, mark)
  solved <- data$bars[!data$bars$unsolved, ]
  given_up <- data$bars[data$bars$unsolved, ]
  at <- union(1, round_ticks(max(solved$round)))
  ggplot2::ggplot(data$bars, ggplot2::aes(x = .data$x)) +
    ggplot2::geom_col(ggplot2::aes(y = .data$searches, fill = .data$lucky), width = 0.8) +
    ggplot2::geom_line(ggplot2::aes(y = .data$expected, group = 1), solved,
                       colour = okabe_ito$blue, linewidth = 1) +
    ggplot2::geom_errorbar(ggplot2::aes(ymin = .data$expected, ymax = .data$expected), given_up,
                           colour = okabe_ito$blue, width = 1, linewidth = 1) +
    ggplot2::scale_fill_manual(
      values = c(`FALSE` = okabe_ito$sky_blue, `TRUE` = okabe_ito$vermillion), guide = "none"
    ) +
    ggplot2::scale_x_continuous(
      breaks = c(at, given_up$x), labels = c(at, rep("not\nsolved", nrow(given_up)))
    ) +
    ggplot2::annotate("text", x = max(solved$x), y = Inf, colour = okabe_ito$vermillion,
                      hjust = 1, vjust = 1.2,
                      label = paste(data$mark_label, collapse = "\n")) +
    ggplot2::labs(title = luck_title(object), subtitle = paste("line:", data$curve_label),
                  x = "rounds to solve", y = "searches")
}
