#' Plot a landscape
#'
#' Show the mean return of the networks around the best policy of a search. Lighter is higher; lines
#' connect equal returns. The cross in the middle is the best policy. The thick line is the target.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [search_landscape()].
#' @param main The title. `NULL`, the default, names the environment.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if no network was played to the end.
#' @rdname plot.gym_landscape
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search_landscape(search, size = 5, episodes = 2, seed = 1))
autoplot.gym_landscape <- function(object, ...) {
  check_dots_empty(...)
  levels <- landscape_levels(object)
  line <- if (length(levels$target)) target_label(levels$target)
  heights <- function(at, mapping = NULL, ...) {
    if (length(at)) ggplot2::geom_contour(mapping, breaks = at, na.rm = TRUE, ...)
  }
  place <- ggplot2::aes(.data$a, .data$b)
  best <- function(...) {
    ggplot2::geom_point(
      ..., data = data.frame(a = 0, b = 0), inherit.aes = FALSE, shape = 4, size = 3
    )
  }
  ggplot2::ggplot(object$grid, ggplot2::aes(.data$a, .data$b, z = .data$mean_return)) +
    ggplot2::geom_raster(ggplot2::aes(fill = .data$mean_return)) +
    heights(levels$plain, colour = "white", linewidth = 0.3) +
    heights(levels$target, ggplot2::aes(colour = line), linewidth = 1.1) +
    best(place, colour = "white", stroke = 3) +
    best(ggplot2::aes(.data$a, .data$b, colour = "best policy"), stroke = 1.5) +
    continuous_fill("mean return", value_colours(), limits = levels$range, na.value = "white") +
    key_of_marks(c(
      list(`best policy` = key_mark("ink", shape = 4)),
      if (length(levels$target)) stats::setNames(list(key_mark("ink", line = "solid")), line)
    )) +
    ggplot2::scale_x_continuous(expand = c(0, 0)) +
    ggplot2::scale_y_continuous(expand = c(0, 0)) +
    picture_labels(
      env_text(object), "networks around the best policy", x = "first direction",
      y = "second direction"
    ) +
    theme_gym()
}

#' Find the heights of a landscape's contour lines
#' @return A list: `range` (of the colours), `plain`, and `target`, if it has a line.
#' @noRd
landscape_levels <- function(x, call = rlang::caller_env()) {
  played <- x$grid$mean_return
  if (all(is.na(played))) {
    gym_abort(
      "There is nothing to plot: the landscape was interrupted before a network had played.",
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  span <- range(played, na.rm = TRUE)
  inside <- function(level) level[level > span[[1L]] & level < span[[2L]]]
  list(
    range = if (diff(span) > 0) span else span + c(-1, 1),
    # After an interrupt there may be holes and no line; ggplot2 would warn.
    plain = if (!anyNA(played)) setdiff(inside(pretty(span, 5L)), x$target),
    target = if (!anyNA(played)) inside(x$target)
  )
}
