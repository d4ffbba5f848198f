#' Plot a search
#'
#' Shows how a search went: every episode as a point, the mean of each round as a
#' line, the target as a dashed line. Episodes of a round that have almost the same
#' return are set side by side.
#'
#' With another `type` it shows the network that was found, or plays the networks around it
#' and shows their landscape, which takes some seconds each time: [search_landscape()] plays them
#' once.
#'
#' `autoplot()` makes the picture, a ggplot, to which scales, themes and layers can be added;
#' `plot()` prints it, too.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A search, as [search_random()] returns it.
#' @param type What to show: `"returns"`, the default; `"network"`, the best policy, as
#'   [plot.gym_policy_network()]; or `"landscape"`, which plays [search_landscape()].
#' @param main The title; `NULL`, the default, says what was searched.
#' @param ... The arguments of the network's picture, or of [search_landscape()], such as `size` and
#'   `seed`. Further arguments of `plot()` are those of `autoplot()`.
#' @return A ggplot; of `plot()` invisibly.
#' @section Errors: `gym_error_argument` when no round was played to its end.
#' @rdname plot.gym_search
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search)
#' plot(search, type = "network")
autoplot.gym_search <- function(object, type = c("returns", "network", "landscape"), ...) {
  type <- check_choice(type[1L], c("returns", "network", "landscape"), arg = "type")
  if (type == "network") {
    check_found(object)
    return(autoplot.gym_policy_network(object$policy, ...))
  }
  if (type == "landscape") {
    return(autoplot.gym_landscape(search_landscape(object, ...)))
  }
  check_dots_empty(...)
  check_has_rounds(object)
  means <- object$rounds
  target <- finite_target(object$target)
  ggplot2::ggplot(search_points(object, target), ggplot2::aes(.data$x, .data$return)) +
    target_line(target) +
    ggplot2::geom_point(ggplot2::aes(colour = "episode"), size = 1.8) +
    ggplot2::geom_line(
      ggplot2::aes(.data$round, .data$mean_return, colour = "mean of the round"), means,
      linewidth = 0.7
    ) +
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
      paste("Random search in", object$env_id), search_outcome(object), x = "round", y = "return"
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

# The episodes with their place `x` on the axis.
search_points <- function(x, target) {
  points <- x$episodes[c("round", "return")]
  high <- diff(range(points$return, target))
  points$x <- points$round + spread(points$round, points$return, high / 50)
  points
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
