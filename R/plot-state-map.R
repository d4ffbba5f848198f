#' Plot what a policy does in each state
#'
#' Shows the action that a policy takes in each state as an arrow or a letter and a colour: on the
#' lake of FrozenLake, beside the cliff of CliffWalking, on the grid of Taxi for one passenger and
#' destination, and on any other grid whose `columns` are given. Otherwise each state has a point.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @inheritParams plot.gym_solution
#' @param x,object What [decision_map()] returned for Discrete observations.
#' @param columns How many columns the grid has, where states are numbered row by row from the upper
#'   left; `NULL`, the default, for what is known of the environment: 12 of CliffWalking, and of
#'   FrozenLake as many as it has rows.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @export
#' @examples
#' right <- policy_table(matrix(c(0, 0, 1, 0), 16, 4, byrow = TRUE))
#' @examplesIf gym:::can_start_server()
#' plot(decision_map("FrozenLake-v1", right))
plot.gym_state_map <- function(x, columns = NULL, directions = NULL, passenger = 2,
                               destination = 0, main = NULL, ...) {
  check_dots_empty(...)
  data <- state_map_data(x, columns, directions, passenger, destination)
  if (is.null(data$columns)) draw_state_actions(data) else draw_state_grid(data)
  title_above(main %||% played_title(x))
  invisible(x)
}

state_map_data <- function(x, columns, directions, passenger, destination,
                           call = rlang::caller_env()) {
  check_count(columns, allow_null = TRUE, call = call)
  cells <- x$grid
  count <- nrow(cells)
  known <- known_grid(x$env_id %||% "")
  directions <- check_directions(
    directions %||% known_directions[[known]], as.integer(x$action_space$n), call
  )
  numbers <- state_numbers(x$action_space)
  place <- match(cells$action, numbers)
  cells$does <- as.character((directions %||% numbers)[place])
  cells$value <- cells$action
  cells$text <- ""
  cells$ends <- FALSE
  palette <- grDevices::adjustcolor(rep_len(line_colours, length(numbers)), 0.35)
  cells$fill <- palette[place]
  shown <- if (known == "Taxi" && is.null(columns)) {
    taxi_cells(cells, passenger, destination, integer(), call)
  } else {
    side <- sqrt(count)
    own <- switch(known, CliffWalking = 12L, FrozenLake = if (side == trunc(side)) as.integer(side))
    grid_cells(cells, columns %||% own, call)
  }
  c(shown, list(fill = shown$cells$fill))
}

draw_state_actions <- function(data) {
  cells <- data$cells
  open_plot(
    list(x = range(cells$state), y = range(cells$action), xlab = "state", ylab = "action"), list()
  )
  graphics::points(cells$state, cells$action, pch = 16L, col = okabe_ito$blue)
}

#' @rdname plot.gym_state_map
#' @exportS3Method ggplot2::autoplot
autoplot.gym_state_map <- function(object, ..., columns = NULL, directions = NULL, passenger = 2,
                                   destination = 0) {
  check_dots_empty(...)
  data <- state_map_data(object, columns, directions, passenger, destination)
  cells <- data$cells
  if (is.null(data$columns)) {
    return(
      ggplot2::ggplot(cells, ggplot2::aes(x = .data$state, y = .data$action)) +
        ggplot2::geom_point(colour = okabe_ito$blue) +
        ggplot2::labs(title = played_title(object))
    )
  }
  cells$does <- with_arrow_signs(cells$does)
  ggplot2::ggplot(cells, ggplot2::aes(x = .data$column, y = .data$row)) +
    ggplot2::geom_tile(fill = cells$fill, colour = "grey80") +
    ggplot2::geom_text(ggplot2::aes(label = .data$does)) +
    ggplot2::scale_y_reverse() +
    ggplot2::coord_fixed() +
    ggplot2::theme_void() +
    ggplot2::labs(title = played_title(object))
}
