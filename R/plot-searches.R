#' Plot how many rounds searches needed
#'
#' Shows how many rounds searches with different seeds needed, as bars, beside the
#' geometric distribution with the chance of a round, as a line. The bars up to round `mark`
#' stand out, and a text says how many searches needed no more than that: `mark = 3`, the
#' default, is as many as the tutorial *Artificial Intelligence in R (I)* (2018) needed. The
#' searches that were not solved have a bar of their own at the right end.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object Searches, as [search_repeat()] returns them.
#' @param mark Up to which round bars are marked, a whole number of at least 1, or `NULL` to mark
#'   nothing.
#' @param main The title; the default describes what was searched and how often.
#' @param xlab,ylab The axes' labels.
#' @param ... Further arguments of [plot()][graphics::plot.default()], such as `xlim`; not
#'   used by `autoplot()`.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when no search was solved.
#' @references The geometric distribution: [stats::dgeom()], counted from the first round.
#' @export
#' @examplesIf gym:::can_start_server()
#' plot(search_repeat("CartPole-v0", seeds = 1:10))
plot.gym_searches <- function(x, mark = 3, main = searches_title(x), xlab = "rounds to solve",
                              ylab = "searches", ...) {
  data <- searches_plot_data(x, mark)
  bars <- data$bars
  open_plot(
    list(x = data$xlim, y = data$ylim, xlab = xlab, ylab = ylab, xaxt = "n", yaxt = "n",
         yaxs = "i"),
    list(...)
  )
  searches_axis(data)
  graphics::rect(bars$x - 0.4, 0, bars$x + 0.4, bars$searches, border = NA,
                 col = ifelse(bars$marked, okabe_ito$vermillion, okabe_ito$sky_blue))
  curve <- bars[!bars$unsolved, ]
  graphics::lines(curve$x, curve$expected, col = okabe_ito$blue, lwd = 2)
  unsolved <- bars[bars$unsolved, ]
  graphics::segments(unsolved$x - 0.4, unsolved$expected, unsolved$x + 0.4, col = okabe_ito$blue,
                     lwd = 2)
  title_above(main)
  legend_above(
    labels = c("searches", data$curve_label), col = c(okabe_ito$sky_blue, okabe_ito$blue),
    pch = c(15L, NA), lty = c(NA, "solid")
  )
  corner_text(data$mark_label, max(curve$x))
  invisible(x)
}

searches_title <- function(x) {
  paste0("Random search in ", x$env_id, ", ", count_of(nrow(x$searches), "seed"))
}

#' Compute what a plot of searches shows
#' @return A list: `bars` (data frame: `round`, `x`, the place on the axis, `searches`, how
#'   many were solved in it, `expected`, how many the geometric distribution gives, `marked`,
#'   `unsolved`, the latter in the last row, where there is one), `curve_label`,
#'   `mark_label` (`NULL` without a mark), `marked` (shares of the searches up to the mark:
#'   `expected` and `observed`), `xlim`, `ylim`.
#' @noRd
searches_plot_data <- function(x, mark = 3, call = rlang::caller_env()) {
  check_count(mark, allow_null = TRUE, call = call)
  if (!isTRUE(x$chance > 0)) {
    gym_abort(
      c("There is nothing to plot: no search was solved, so that the chance of a round is unknown.",
        i = "More `rounds` or more `seeds` may help, or a lower `target`."),
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  bars <- searches_bars(x)
  bars$marked <- !bars$unsolved & bars$round <= (mark %||% 0)
  marked <- if (!is.null(mark)) {
    list(
      expected = stats::pgeom(mark - 1, x$chance),
      observed = mean(x$searches$solved & x$searches$round <= mark)
    )
  }
  list(
    bars = bars,
    marked = marked,
    curve_label = paste0("geometric, chance of a round ", percent_text(x$chance)),
    mark_label = if (!is.null(mark)) marked_label(mark, marked),
    xlim = c(0.5, max(bars$x) + 0.5),
    ylim = c(0, 1.05 * max(bars$searches, bars$expected))
  )
}

# A row for each round up to the last in which a search was solved, and one for the searches that
# were not solved.
searches_bars <- function(x) {
  n <- nrow(x$searches)
  unsolved <- sum(!x$searches$solved)
  last <- if (unsolved > 0L) x$max_rounds else max(x$searches$round)
  round <- seq_len(last)
  bars <- data.frame(
    round = round, x = as.numeric(round), searches = tabulate(x$searches$round, last),
    expected = n * stats::dgeom(round - 1, x$chance), unsolved = FALSE
  )
  if (unsolved > 0L) {
    bars <- rbind(bars, data.frame(
      round = NA, x = last + max(2, 0.14 * last), searches = unsolved,
      expected = n * (1 - x$chance)^last, unsolved = TRUE
    ))
  }
  bars
}

marked_label <- function(mark, marked) {
  c(
    paste0("Solved ", if (mark == 1) "in the first round:" else paste("within", mark, "rounds:")),
    paste(percent_text(marked$expected), "by the curve,"),
    paste(percent_text(marked$observed), "of these searches")
  )
}

searches_axis <- function(data) {
  solved <- data$bars[!data$bars$unsolved, ]
  graphics::axis(1L, at = union(1, round_ticks(max(solved$round))))
  # Numbers of searches are whole, too.
  graphics::axis(2L, at = unique(round(pretty(data$ylim))), las = 1L)
  unsolved <- data$bars[data$bars$unsolved, ]
  if (nrow(unsolved)) {
    graphics::mtext("not\nsolved", 1L, line = 1.5, at = unsolved$x,
                    cex = 0.8 * graphics::par("cex"))
  }
}

#' @rdname plot.gym_searches
#' @exportS3Method ggplot2::autoplot
autoplot.gym_searches <- function(object, mark = 3, ...) {
  data <- searches_plot_data(object, mark)
  solved <- data$bars[!data$bars$unsolved, ]
  unsolved <- data$bars[data$bars$unsolved, ]
  at <- union(1, round_ticks(max(solved$round)))
  ggplot2::ggplot(data$bars, ggplot2::aes(x = .data$x)) +
    ggplot2::geom_col(ggplot2::aes(y = .data$searches, fill = .data$marked), width = 0.8) +
    ggplot2::geom_line(ggplot2::aes(y = .data$expected, group = 1), solved,
                       colour = okabe_ito$blue, linewidth = 1) +
    ggplot2::geom_errorbar(ggplot2::aes(ymin = .data$expected, ymax = .data$expected), unsolved,
                           colour = okabe_ito$blue, width = 1, linewidth = 1) +
    ggplot2::scale_fill_manual(
      values = c(`FALSE` = okabe_ito$sky_blue, `TRUE` = okabe_ito$vermillion), guide = "none"
    ) +
    ggplot2::scale_x_continuous(
      breaks = c(at, unsolved$x), labels = c(at, rep("not\nsolved", nrow(unsolved)))
    ) +
    ggplot2::annotate("text", x = max(solved$x), y = Inf, colour = okabe_ito$vermillion,
                      hjust = 1, vjust = 1.2,
                      label = paste(data$mark_label, collapse = "\n")) +
    ggplot2::labs(title = searches_title(object), subtitle = paste("line:", data$curve_label),
                  x = "rounds to solve", y = "searches")
}
