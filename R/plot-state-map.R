#' Plot what a policy does in each state
#'
#' Show the action of a policy in each state as a colour and an arrow or a letter. Supported grids
#' are FrozenLake, CliffWalking, Taxi (for one passenger and destination) and any other grid whose
#' `columns` you give. Otherwise each state has a point.
#'
#' With `type = "q"` it shows the values of all actions instead, if the policy is a table of values:
#' a triangle for each direction, as in [plot.gym_solution()]. A state is empty if all its actions
#' have the same value, as in a state that was never left.
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
  shown <- if (type == "q") "values of actions" else policy_subtitle(object)
  picture +
    picture_labels(object$env_id %||% "Decision map", c(shown, taxi_subtitle(data)), width = 40)
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
  differs <- row_max(q) > -row_max(-q)
  data$cells$value <- ifelse(differs[match(data$cells$state, x$grid$state)], 0, NA)
  q_of_cells(q, x$grid$state, data)
}

#' Compute the data of a map of states
#' @return As [solution_plot_data()], with `action`, a factor, instead of values, and `colours`, one
#'   for each action.
#' @noRd
state_map_data <- function(x, columns, directions, passenger, destination,
                           call = rlang::caller_env()) {
  check_count(columns, allow_null = TRUE, call = call)
  cells <- x$grid
  known <- known_grid(x$env_id %||% "")
  numbers <- state_numbers(x$action_space)
  directions <- action_directions(directions, known, numbers, call)
  place <- match(cells$action, numbers)
  cells$does <- factor(directions[place], unique(directions))
  labels <- action_names(x$env_id, length(numbers), numbers[[1L]])
  cells$action <- factor(labels[place], labels)
  cells$ink <- "black"
  side <- sqrt(nrow(cells))
  own <- switch(known, CliffWalking = 12L, FrozenLake = if (side == trunc(side)) as.integer(side))
  placed <- place_states(cells, known, columns, own, passenger, destination, integer(), call)
  colours <- stats::setNames(action_colours(length(labels)), labels)
  c(placed, list(directions = directions, colours = colours))
}
