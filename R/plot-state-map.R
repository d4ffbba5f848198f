#' Plot what a policy does in each state
#'
#' Show the action of a policy in each state as a colour and an arrow or a letter. Supported grids
#' are FrozenLake, CliffWalking, Taxi (for one passenger and destination) and any other grid whose
#' `columns` you give. Otherwise each state has a point. States without an action, such as terminal
#' ones and those that were never visited, are empty (see [decision_map()]). If there are more than
#' six actions, the colours are a scale of their numbers.
#'
#' With `type = "q"` it shows the values of all actions instead, if the policy is a table of values:
#' a triangle for each direction, as in [plot.gym_solution()].
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_solution
#' @param x,object The result of [decision_map()] for Discrete observations.
#' @param columns The number of columns of the grid, whose states are numbered row by row from the
#'   upper left. `NULL`, the default, for a known environment: 12 for CliffWalking, and as many as
#'   rows for FrozenLake.
#' @param type What to show, a string: `"actions"`, the default, or `"q"`, the values of all
#'   actions.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if `type` is `"q"` and the policy is not a table.
#' @rdname plot.gym_state_map
#' @exportS3Method ggplot2::autoplot
#' @examples
#' right <- policy_table(matrix(c(0, 0, 1, 0), 16, 4, byrow = TRUE))
#' @examplesIf gym:::can_start_server()
#' plot(decision_map("FrozenLake-v1", right))
#' learned <- learn_q("FrozenLake-v1", total_steps = 20000, is_slippery = FALSE, seed = 1)
#' plot(decision_map("FrozenLake-v1", learned$policy), type = "q")
autoplot.gym_state_map <- function(object, ..., type = c("actions", "q"), columns = NULL,
                                   directions = NULL, passenger = 2, destination = 0) {
  check_dots_empty(...)
  type <- check_choice(type[1L], c("actions", "q"), arg = "type")
  data <- state_map_data(object, columns, directions, passenger, destination)
  if (type == "q") data$q <- q_of_table(object, data)
  picture <- if (type == "q") {
    if (is.null(data$columns)) q_points(data) else grid_picture(data, q_layers(data))
  } else if (is.null(data$columns)) {
    action_points(data)
  } else {
    cells <- data$cells[!is.na(data$cells$action), ]
    taken <- intersect(data$labels, data$labels[match(cells$action, data$numbers)])
    cells$shown <- shown_actions(cells$action, data$numbers, data$labels)
    grid_picture(data, c(
      list(
        cell_tiles(ggplot2::aes(fill = .data$shown), cells), cell_tiles(fill = NA),
        action_fill(data$numbers, data$labels, "action", taken, ggplot2::guide_legend())
      ),
      action_layers(data, cells)
    ))
  }
  shown <- if (type == "q") "values of actions" else policy_subtitle(object)
  picture +
    picture_labels(env_text(object) %||% "Decision map", c(shown, taxi_subtitle(data)), width = 40)
}

# The action in each state without a grid. Few actions have their names on the axis.
action_points <- function(data) {
  cells <- data$cells[!is.na(data$cells$action), ]
  few <- length(data$numbers) <= most_named_actions
  names <- ifelse(data$directions == data$numbers, data$labels, data$directions)
  ggplot2::ggplot(cells, ggplot2::aes(.data$state, .data$action)) +
    ggplot2::geom_point(colour = gym_colours[["blue"]]) +
    ggplot2::scale_x_continuous(breaks = few_breaks, limits = range(data$cells$state)) +
    ggplot2::scale_y_continuous(
      breaks = if (few) data$numbers else few_breaks,
      labels = if (few) broken_texts(names, 24) else ggplot2::waiver(),
      limits = if (few) range(data$numbers)
    ) +
    ggplot2::labs(x = "state", y = "action") +
    theme_gym()
}

q_of_table <- function(x, data, call = rlang::caller_env()) {
  if (!inherits(x$policy, "gym_policy_table")) {
    gym_abort(
      paste0("Values of actions are those of a `policy_table()`, not of ",
             describe_argument(x$policy), "."),
      class = "gym_error_argument", argument = "type", value = x$policy, call = call
    )
  }
  q <- x$policy$q
  data$cells$value <- ifelse(is.na(data$cells$action), NA, 0)
  q_of_cells(q, x$grid$state, data)
}

#' Compute the data of a map of states
#' @return As [solution_plot_data()], with `action`, a number or `NA`, instead of values, and the
#'   `numbers` and `labels` of all actions.
#' @noRd
state_map_data <- function(x, columns, directions, passenger, destination,
                           call = rlang::caller_env()) {
  check_count(columns, allow_null = TRUE, call = call)
  cells <- x$grid
  known <- known_grid(x$env_id %||% "")
  numbers <- state_numbers(x$action_space)
  directions <- action_directions(directions, known, numbers, call)
  cells$does <- directions[match(cells$action, numbers)]
  labels <- action_names(x$env_id, length(numbers), numbers[[1L]])
  cells$ink <- "black"
  side <- sqrt(nrow(cells))
  own <- switch(known, CliffWalking = 12L, FrozenLake = if (side == trunc(side)) as.integer(side))
  placed <- place_states(cells, known, columns, own, passenger, destination, integer(), call)
  c(placed, list(directions = directions, numbers = numbers, labels = labels))
}
