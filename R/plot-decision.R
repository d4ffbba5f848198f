#' Plot a decision map
#'
#' Show the actions of a policy over two parts of the observation. The colour is one of three
#' things: the output of a network that is rounded to one of two actions, with a line at one half;
#' the action itself; or a number of an action that is a Box, with a line at the middle of its
#' bounds. The path of an episode starts at the ring and ends at the cross.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [decision_map()].
#' @param xlab,ylab The axes' labels, strings. `NULL`, the default, uses the names of the parts,
#'   with their units if Gymnasium's documentation has them.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_decision_map
#' @exportS3Method ggplot2::autoplot
#' @examples
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 0.3), nrow = 1)))
#' plot(decision_map(policy = follow, x = 3, y = 4, xlim = c(-0.2, 0.2), ylim = c(-3, 3)))
autoplot.gym_decision_map <- function(object, ...) {
  check_dots_empty(...)
  data <- decision_plot_data(object)
  ggplot2::ggplot(data$points, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_raster(ggplot2::aes(fill = .data$shown)) +
    data$fill +
    data$border +
    path_layers(object$path) +
    ggplot2::scale_x_continuous(expand = c(0, 0)) +
    ggplot2::scale_y_continuous(expand = c(0, 0)) +
    map_labels(object, policy_subtitle(object)) +
    theme_gym()
}

map_labels <- function(x, subtitle, axes = TRUE, ...) {
  of_part <- function(name) if (axes) observation_labels(described_id(x), x[[name]])
  labels <- Filter(Negate(is.null), list(x = of_part("x"), y = of_part("y")))
  title <- env_text(x) %||% "Decision map"
  do.call(picture_labels, c(list(title, subtitle), labels, list(...)))
}

path_layers <- function(path) {
  if (is.null(path)) {
    return(NULL)
  }
  ends <- function(last) path[!duplicated(path$episode, fromLast = last), ]
  several <- path[path$episode %in% path$episode[duplicated(path$episode)], ]
  way <- function(...) ggplot2::geom_path(ggplot2::aes(group = .data$episode), several, ...)
  list(
    way(colour = "white", linewidth = 1.5), way(linewidth = 0.5),
    ggplot2::geom_point(data = ends(FALSE), shape = 21, fill = "white", size = 3, stroke = 1),
    ggplot2::geom_point(data = ends(TRUE), shape = 4, size = 2.5, stroke = 1.5)
  )
}

#' Compute the data of a plot of a decision map
#' @return A list: `points` (data frame `x`, `y`, `shown`, a number or a factor), `fill` (the colour
#'   scale), `border` (the layer of the border line, or `NULL`).
#' @noRd
decision_plot_data <- function(x) {
  points <- stats::setNames(x$grid, c("x", "y", "shown"))
  if (x$kind == "choice") {
    start <- as.integer(sub(":.*", "", x$actions[[1L]]))
    numbers <- start + seq_along(x$actions) - 1L
    found <- x$actions[sort(unique(points$shown - start + 1))]
    points$shown <- shown_actions(points$shown, numbers, x$actions)
    return(list(points = points, fill = action_fill(numbers, x$actions, taken = found)))
  }
  if (x$kind == "output") {
    # With small weights, outputs differ little. So the colours span only the range of the outputs
    # around one half.
    border <- 0.5
    limits <- border + c(-1, 1) * max(abs(points$shown - border), 0.01)
    name <- paste0("output, above 0.5:\n", x$actions[[2L]])
  } else {
    limits <- x$limits %||% range(points$shown)
    # A colour scale needs a range, also if there is only one value.
    if (diff(limits) == 0) limits <- limits + c(-1, 1)
    name <- x$actions
    border <- mean(limits)
  }
  inside <- range(points$shown)
  list(
    points = points, fill = continuous_fill(name, diverging_colours, limits = limits),
    # Draw the line between two actions only if both occur, because ggplot2 warns about an empty
    # line.
    border = if (border > inside[[1L]] && border < inside[[2L]]) {
      ggplot2::geom_contour(
        ggplot2::aes(z = .data$shown), breaks = border, colour = "black", linewidth = 0.8
      )
    }
  )
}

# States -------------------------------------------------------------------------------

#' Plot what a policy does in each state
#'
#' Show the action of a policy in each state as a colour and an arrow or a letter. FrozenLake,
#' CliffWalking and Taxi (for one passenger and destination) are drawn as grids, and so is any other
#' environment if you give `columns`. Otherwise each state has a point. States without an action,
#' such as terminal ones and those that were never visited, are empty (see [decision_map()]). If
#' there are more than six actions, the colours are a scale of their numbers.
#'
#' If observations have several parts with few values each, two of them are on the axes, and there
#' is a panel for each value of the others. If there is room in a state's cell, it has the number of
#' the action. For Blackjack this is figure 5.2 of Sutton and Barto (2018).
#'
#' If the policy is a table of values, `type = "q"` shows the values of all actions instead: a
#' triangle for each direction, as in [plot.gym_solution()].
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_solution
#' @param x,object The result of [decision_map()] for Discrete observations, or for those of several
#'   parts with few values each.
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
#' # Sticks with 20 or 21.
#' sums <- rep(0:31, each = 22)
#' sticks <- policy_table(cbind(sums >= 20, sums < 20) + 0)
#' plot(decision_map("Blackjack-v1", sticks, "dealer_card", "player_sum", xlim = c(1, 10),
#'                   ylim = c(12, 21)))
autoplot.gym_state_map <- function(object, ..., type = c("actions", "q"), columns = NULL,
                                   directions = NULL, passenger = 2, destination = 0) {
  check_dots_empty(...)
  by_parts <- object$kind == "parts"
  type <- check_choice(type[1L], c("actions", if (!by_parts) "q"), arg = "type")
  data <- if (by_parts) {
    parts_map_data(object)
  } else {
    place_states(
      data.frame(object$grid, ink = "black"), object$env_id, object, columns, directions,
      passenger, destination, rlang::current_env()
    )
  }
  if (type == "q") {
    if (!inherits(object$policy, "gym_policy_table")) {
      abort_wrong("type", object$policy, rlang::current_env(),
                  "Values of actions are those of a `policy_table()`, not of
                   {describe_argument(object$policy)}.")
    }
    data$cells$value <- ifelse(is.na(data$cells$action), NA, 0)
    data$q <- q_of_cells(object$policy$q, object$grid$state, data)
  }
  picture <- if (!is.null(data$columns)) {
    grid_picture(data, if (type == "q") q_layers(data) else taken_layers(data))
  } else if (type == "q") {
    q_cells(data)
  } else {
    ggplot2::ggplot(data$cells, ggplot2::aes(.data$state, .data$action)) +
      ggplot2::geom_point(colour = gym_colours[["blue"]], na.rm = TRUE) +
      ggplot2::expand_limits(y = range(data$numbers)) +
      state_axes(data)
  }
  shown <- if (type == "q") "values of actions" else policy_subtitle(object)
  picture + map_labels(object, c(shown, taxi_subtitle(data)), axes = by_parts, width = 40)
}

# Fills each cell with the colour of the action that is taken there.
taken_layers <- function(data) {
  cells <- data$cells[!is.na(data$cells$action), ]
  cells$shown <- shown_actions(cells$action, data$numbers, data$labels)
  taken <- intersect(data$labels, data$labels[match(cells$action, data$numbers)])
  c(
    list(
      cell_tiles(ggplot2::aes(fill = .data$shown), cells), cell_tiles(fill = NA),
      action_fill(data$numbers, data$labels, "action", taken, ggplot2::guide_legend())
    ),
    action_layers(data, cells)
  )
}

# The parts on the axes become columns and rows. The other parts become `panels` if they have
# several values.
parts_map_data <- function(x) {
  cells <- x$grid
  counts <- lengths(lapply(cells[c(x$x, x$y, x$panels)], unique))
  cells$column <- cells[[x$x]]
  cells$row <- cells[[x$y]]
  cells$ink <- "black"
  numbers <- state_numbers(x$action_space)
  data <- list(
    columns = prod(counts[-2L]), rows = counts[[2L]], panels = x$panels[counts[x$panels] > 1L],
    has_axes = TRUE, numbers = numbers, labels = x$actions
  )
  readable <- 0.4 * cell_width(data) / max(nchar(numbers)) > 1.5
  cells$does <- if (readable) as.character(cells$action) else ""
  c(data, list(cells = cells))
}
