#' Plot what a policy does in states of several parts
#'
#' Shows the action in each state as a colour, with two parts of the observation on the axes and a
#' panel for each value of the others: for Blackjack the picture of Sutton and Barto (2018), figure
#' 5.2.
#'
#' @param x,object What [decision_map()] returned for observations of several parts with few values
#'   each.
#' @param main The title; `NULL`, the default, names the environment.
#' @param ... Not used.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @export
#' @examplesIf gym:::can_start_server() && requireNamespace("ggplot2", quietly = TRUE)
#' # Sticks with 20 or 21.
#' sums <- rep(0:31, each = 22)
#' sticks <- policy_table(cbind(sums >= 20, sums < 20) + 0)
#' map <- decision_map("Blackjack-v1", sticks, "dealer_card", "player_sum", xlim = c(1, 10),
#'                     ylim = c(12, 21))
#' plot(map)
plot.gym_parts_map <- function(x, main = NULL, ...) {
  check_dots_empty(...)
  rlang::check_installed("ggplot2", "to plot a map of several parts.")
  print(autoplot.gym_parts_map(x) + ggplot2::labs(title = main %||% played_title(x)))
  invisible(x)
}

#' @rdname plot.gym_parts_map
#' @exportS3Method ggplot2::autoplot
autoplot.gym_parts_map <- function(object, ...) {
  check_dots_empty(...)
  cells <- object$grid
  numbers <- state_numbers(object$action_space)
  cells$does <- factor(object$actions[match(cells$action, numbers)], object$actions)
  picture <- ggplot2::ggplot(
    cells, ggplot2::aes(x = .data[[object$x]], y = .data[[object$y]], fill = .data$does)
  ) +
    ggplot2::geom_tile(colour = "white") +
    ggplot2::scale_fill_manual(values = rep_len(line_colours, length(numbers)), drop = FALSE) +
    ggplot2::labs(x = object$x, y = object$y, fill = "action", title = played_title(object))
  if (length(object$panels)) {
    picture <- picture +
      ggplot2::facet_wrap(object$panels, labeller = ggplot2::label_both)
  }
  picture
}
