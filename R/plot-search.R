#' Plot a search
#'
#' Show every episode of a search as a point, the mean of each round as a line, and the target as a
#' dashed line. Points of a round with almost the same return are side by side.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A search, as returned by [search_random()].
#' @param type What to show: `"returns"`, the default; or `"network"`, the best policy, by
#'   [plot.gym_policy_network()].
#' @param main The title. `NULL`, the default, describes the search.
#' @param ... Arguments of the network's picture. `plot()` passes its arguments to `autoplot()`.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if no round was played to its end.
#' @rdname plot.gym_search
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search)
#' plot(search, type = "network")
autoplot.gym_search <- function(object, type = c("returns", "network"), ...) {
  type <- check_choice(type[1L], c("returns", "network"), arg = "type")
  if (type == "network") {
    check_found(object)
    return(autoplot.gym_policy_network(object$policy, ...))
  }
  check_dots_empty(...)
  check_has_rounds(object)
  means <- object$rounds
  target <- finite_target(object$target)
  ggplot2::ggplot(search_points(object, target), ggplot2::aes(.data$x, .data$return)) +
    target_line(target) +
    ggplot2::geom_point(ggplot2::aes(colour = "episode"), size = 1.8) +
    # ggplot2 has a message for a line of one point.
    (if (nrow(means) > 1L) ggplot2::geom_line(
      ggplot2::aes(.data$round, .data$mean_return, colour = "mean of the round"), means,
      linewidth = 0.7
    )) +
    ggplot2::geom_point(
      ggplot2::aes(.data$round, .data$mean_return, colour = "mean of the round"), means, shape = 15
    ) +
    key_of_marks(c(
      list(
        episode = key_mark("sky", shape = 16),
        `mean of the round` = key_mark("blue", shape = 15, line = "solid")
      ),
      target_mark(target)
    )) +
    ggplot2::scale_x_continuous(breaks = round_ticks(max(means$round))) +
    picture_labels(
      paste("Random search in", env_text(object)), search_outcome(object), x = "round", y = "return"
    ) +
    theme_gym()
}

check_has_rounds <- function(x, call = rlang::caller_env()) {
  if (nrow(x$rounds) == 0L) {
    gym_abort(
      "There is nothing to plot: the search ended before its first round was played to its end.",
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
}

search_outcome <- function(x) {
  if (x$solved) {
    paste("solved in round", x$round)
  } else if (!is.null(x$target)) {
    paste("not solved in", count_of(nrow(x$rounds), "round"))
  }
}

# The episodes with their `x` on the axis.
search_points <- function(x, target) {
  points <- x$episodes[c("round", "return")]
  high <- diff(range(points$return, target))
  points$x <- points$round + spread(points$round, points$return, high / 50)
  points
}

# Offsets that put returns of one round side by side if they are closer than `near`. They are not
# random, because a plot must not use R's generator.
spread <- function(round, value, near) {
  bin <- if (near > 0) round(value / near) else value * 0
  group <- interaction(round, bin, drop = TRUE)
  place <- stats::ave(value, group, FUN = seq_along)
  size <- stats::ave(value, group, FUN = length)
  0.6 * (place - (size + 1) / 2) / max(size, 5)
}
