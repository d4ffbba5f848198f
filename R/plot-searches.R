#' Plot how many rounds searches needed
#'
#' Show the number of rounds that searches with different seeds needed, as bars, and the geometric
#' distribution with the success probability of a round, as a line. The bars up to round `mark` are
#' dark, and a text says how many searches needed no more than that. The default, `mark = 3`, is the
#' number of rounds in the tutorial *Artificial Intelligence in R (I)* (2018). Unsolved searches
#' have a bar of their own at the right end.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object Searches, as returned by [search_repeat()].
#' @param mark The last round with a dark bar, a whole number of at least 1, or `NULL` for none.
#' @param main The title. `NULL`, the default, describes the searches.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if no search was solved.
#' @references The geometric distribution: [stats::dgeom()], counted from the first round.
#' @rdname plot.gym_searches
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' plot(search_repeat("CartPole-v0", seeds = 1:10))
autoplot.gym_searches <- function(object, mark = 3, ...) {
  check_dots_empty(...)
  check_count(mark, allow_null = TRUE)
  check_has_chance(object)
  bars <- searches_bars(object, mark %||% 0)
  solved <- bars[!bars$unsolved, ]
  unsolved <- bars[bars$unsolved, ]
  at <- union(1, round_ticks(max(solved$round)))
  curve <- paste("geometric, chance of a round", percent_text(object$chance))
  ggplot2::ggplot(bars, ggplot2::aes(.data$x)) +
    ggplot2::geom_col(ggplot2::aes(y = .data$searches, fill = .data$marked), width = 0.8) +
    ggplot2::geom_line(ggplot2::aes(y = .data$expected, colour = curve), solved, linewidth = 0.9) +
    ggplot2::geom_errorbar(
      ggplot2::aes(ymin = .data$expected, ymax = .data$expected, colour = curve), unsolved,
      width = 1, linewidth = 0.9, show.legend = FALSE
    ) +
    key_of_marks(stats::setNames(list(key_mark("gold", line = "solid")), curve)) +
    ggplot2::scale_fill_manual(
      values = c(`FALSE` = gym_colours[["sky"]], `TRUE` = gym_colours[["blue"]]), guide = "none"
    ) +
    ggplot2::scale_x_continuous(
      breaks = c(at, unsolved$x), labels = c(axis_numbers(at), rep("not\nsolved", nrow(unsolved)))
    ) +
    ggplot2::scale_y_continuous(breaks = function(limits) unique(round(pretty(limits)))) +
    picture_labels(
      paste("Random search in", env_text(object)),
      c(count_of(nrow(object$searches), "seed"), if (!is.null(mark)) marked_label(object, mark)),
      x = "rounds to solve", y = "searches"
    ) +
    theme_gym()
}

check_has_chance <- function(x, call = rlang::caller_env()) {
  if (!isTRUE(x$chance > 0)) {
    gym_abort(
      c("There is nothing to plot: no search was solved, so the chance of a round is unknown.",
        i = "More `rounds` or more `seeds` may help, or a lower `target`."),
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
}

#' Count the searches by the number of rounds that they needed
#' @return A data frame with a row for each round up to the last in which a search was solved, and
#'   one for the unsolved searches: `round`, `x`, the place on the axis, `searches`, `expected`, the
#'   number by the geometric distribution, `unsolved`, `marked`.
#' @noRd
searches_bars <- function(x, mark) {
  n <- nrow(x$searches)
  unsolved <- sum(!x$searches$solved)
  last <- if (unsolved > 0L) x$max_rounds else max(x$searches$round)
  round <- seq_len(last)
  bars <- data.frame(
    round = round, x = as.numeric(round), searches = tabulate(x$searches$round, last),
    expected = n * stats::dgeom(round - 1, x$chance), unsolved = FALSE, marked = round <= mark
  )
  if (unsolved > 0L) {
    bars <- rbind(bars, data.frame(
      round = NA, x = last + max(2, 0.14 * last), searches = unsolved,
      expected = n * (1 - x$chance)^last, unsolved = TRUE, marked = FALSE
    ))
  }
  bars
}

# The shares of the searches up to the mark, observed and expected.
marked_label <- function(x, mark) {
  observed <- mean(x$searches$solved & x$searches$round <= mark)
  paste0(
    percent_text(observed), " solved ",
    if (mark == 1) "in the first round" else paste("within", mark, "rounds"), ", ",
    percent_text(stats::pgeom(mark - 1, x$chance)), " by the curve"
  )
}
