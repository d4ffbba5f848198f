#' Plot what a policy does in each state
#'
#' Show the action of a policy in each state as a colour and an arrow or a letter. Supported grids
#' are FrozenLake, CliffWalking, Taxi (for one passenger and destination) and any other grid whose
#' `columns` you give. Otherwise each state has a point.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_solution
#' @param x,object The result of [decision_map()] for Discrete observations.
#' @param columns The number of columns of the grid, whose states are numbered row by row from the
#'   upper left. `NULL`, the default, for a known environment: 12 for CliffWalking, and as many as
#'   rows for FrozenLake.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_state_map
#' @exportS3Method ggplot2::autoplot
#' @examples
#' right <- policy_table(matrix(c(0, 0, 1, 0), 16, 4, byrow = TRUE))
#' @examplesIf gym:::can_start_server()
#' plot(decision_map("FrozenLake-v1", right))
autoplot.gym_state_map <- function(object, ..., columns = NULL, directions = NULL, passenger = 2,
                                   destination = 0) {
  check_dots_empty(...)
  data <- state_map_data(object, columns, directions, passenger, destination)
  picture <- if (is.null(data$columns)) {
    ggplot2::ggplot(data$cells, ggplot2::aes(.data$state, .data$does)) +
      ggplot2::geom_point(colour = gym_colours[["blue"]]) +
      ggplot2::scale_x_continuous(breaks = few_breaks) +
      ggplot2::labs(x = "state", y = "action") +
      theme_gym()
  } else {
    taken <- levels(droplevels(data$cells$action))
    grid_picture(data, c(
      list(
        cell_tiles(ggplot2::aes(fill = .data$action)),
        ggplot2::scale_fill_manual(
          name = "action", values = data$colours, limits = taken
        )
      ),
      action_layers(data, data$cells)
    ))
  }
  picture +
    picture_labels(
      object$env_id %||% "Decision map", c(policy_subtitle(object), taxi_subtitle(data)), width = 40
    )
}

#' Compute the data of a map of states
#' @return As [solution_plot_data()], with `action`, a factor, instead of values, and `colours`, one
#'   for each action.
#' @noRd
state_map_data <- function(x, columns, directions, passenger, destination,
                           call = rlang::caller_env()) {
  check_count(columns, allow_null = TRUE, call = call)
  cells <- x$grid
  count <- nrow(cells)
  known <- known_grid(x$env_id %||% "")
  numbers <- state_numbers(x$action_space)
  directions <- check_directions(
    directions %||% known_directions[[known]], as.integer(x$action_space$n), call
  ) %||% as.character(numbers)
  place <- match(cells$action, numbers)
  cells$does <- factor(directions[place], unique(directions))
  labels <- action_names(x$env_id, length(numbers), numbers[[1L]])
  cells$action <- factor(labels[place], labels)
  cells$ink <- "black"
  placed <- if (known == "Taxi" && is.null(columns)) {
    taxi_cells(cells, passenger, destination, integer(), call)
  } else {
    side <- sqrt(count)
    own <- switch(known, CliffWalking = 12L, FrozenLake = if (side == trunc(side)) as.integer(side))
    grid_cells(cells, columns %||% own, call)
  }
  c(placed, list(colours = stats::setNames(action_colours(length(labels)), labels)))
}
