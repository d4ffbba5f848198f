#' Plot what a policy does in states of several parts
#'
#' Show the action in each state as a colour, with two parts of the observation on the axes and a
#' panel for each value of the others. States without an action are empty. Where a state has room,
#' it carries the number of its action. For Blackjack this is figure 5.2 of Sutton and Barto (2018).
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @param object The result of [decision_map()] for observations of several parts with few values
#'   each.
#' @param ... Not used.
#' @return A ggplot.
#' @rdname plot.gym_parts_map
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' # Sticks with 20 or 21.
#' sums <- rep(0:31, each = 22)
#' sticks <- policy_table(cbind(sums >= 20, sums < 20) + 0)
#' plot(decision_map("Blackjack-v1", sticks, "dealer_card", "player_sum", xlim = c(1, 10),
#'                   ylim = c(12, 21)))
autoplot.gym_parts_map <- function(object, ...) {
  check_dots_empty(...)
  cells <- object$grid
  numbers <- state_numbers(object$action_space)
  cells$does <- shown_actions(cells$action, numbers, object$actions)
  values <- lapply(cells[object$panels], unique)
  panels <- names(values)[lengths(values) > 1L]
  sizes <- lengths(lapply(cells[c(object$x, object$y)], unique))
  each <- list(columns = sizes[[1L]] * prod(lengths(values)), rows = sizes[[2L]])
  size <- 0.4 * cell_width(each) / max(nchar(numbers))
  decided <- cells[!is.na(cells$action), ]
  ggplot2::ggplot(cells, ggplot2::aes(x = .data[[object$x]], y = .data[[object$y]])) +
    ggplot2::geom_tile(ggplot2::aes(fill = .data$does), decided, colour = "white") +
    # The axes reach over all states.
    ggplot2::geom_tile(fill = NA, colour = NA) +
    # Smaller text could not be read.
    (if (size > 1.5) {
      ggplot2::geom_text(ggplot2::aes(label = .data$action), decided, size = min(size, 3.2))
    }) +
    action_fill(numbers, object$actions) +
    (if (length(panels)) {
      ggplot2::facet_wrap(panels, labeller = ggplot2::label_both)
    }) +
    ggplot2::scale_x_continuous(breaks = few_breaks, expand = c(0, 0)) +
    ggplot2::scale_y_continuous(breaks = few_breaks, expand = c(0, 0)) +
    picture_labels(
      env_text(object) %||% "Decision map", policy_subtitle(object),
      x = observation_labels(described_id(object), object$x),
      y = observation_labels(described_id(object), object$y)
    ) +
    theme_gym()
}
