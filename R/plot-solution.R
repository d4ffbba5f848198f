#' Plot the values of a solved model
#'
#' Show the value of each state as a colour (darker is lower) and its best action as an arrow or a
#' letter. FrozenLake, CliffWalking and Taxi (for one passenger and destination) are drawn as grids,
#' and so is any other model if you give `columns`. Marks show goals and pits, where episodes end.
#' Cells that an episode never enters, such as walls, are empty. Without a grid, each state has a
#' point, and the actions have their own panel.
#'
#' `type = "q"` shows the value of each action. Each cell has a triangle for each direction, with
#' the best one in bold. Actions that are not directions are left out. Without a grid, each action
#' has a row, with a dot at the best one.
#'
#' If all terminal states give the same reward, they are goals, unless other steps give more on
#' average. Otherwise the terminal states with the largest reward are goals, and the others are
#' pits.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' If states have two columns of names, such as `row` and `column`, these make the grid: the first
#' column goes down, the second to the right. If there are more columns, each of their values has a
#' panel.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [solve_mdp()].
#' @param type What to show, a string: `"values"`, the default, of states; or `"q"`, of actions.
#' @param columns The number of columns of the grid, whose states are numbered row by row from the
#'   upper left. `NULL`, the default, for a known environment.
#' @param directions The meaning of each action on the grid, strings in the order of the actions:
#'   `"left"`, `"right"`, `"up"`, `"down"`, or a letter to write. `NULL`, the default, for a known
#'   environment.
#' @param passenger,destination For Taxi: the passenger's place, from 0 to 3 for the stands R, G, Y
#'   and B, or 4 for the taxi; and the destination, from 0 to 3. The default is a passenger at Y who
#'   goes to R.
#' @param step For a solution with a horizon: the step whose actions to show, from 1, the default.
#' @param main The title. `NULL`, the default, names the environment.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_solution
#' @exportS3Method ggplot2::autoplot
#' @examples
#' # A grid of four by three fields; the goal is at the upper right.
#' fields <- expand.grid(action = 0:3, state = setdiff(0:11, 3))
#' row <- fields$state %/% 4 + c(0, 1, 0, -1)[fields$action + 1]
#' column <- fields$state %% 4 + c(-1, 0, 1, 0)[fields$action + 1]
#' outside <- row < 0 | row > 2 | column < 0 | column > 3
#' fields$next_state <- ifelse(outside, fields$state, 4 * row + column)
#' fields$reward <- -1
#' solved <- solve_mdp(gym_model(fields, start = 8, id = "Four by three"))
#' plot(solved, columns = 4, directions = c("left", "down", "right", "up"))
#' plot(solved, type = "q", columns = 4, directions = c("left", "down", "right", "up"))
#'
#' @examplesIf gym:::can_start_server()
#' plot(solve_mdp("FrozenLake-v1"))
#' plot(solve_mdp("Taxi-v4"), passenger = 2, destination = 0)
autoplot.gym_solution <- function(object, ..., type = c("values", "q"), columns = NULL,
                                  directions = NULL, passenger = 2, destination = 0, step = 1) {
  check_dots_empty(...)
  type <- check_choice(type[1L], c("values", "q"), arg = "type")
  data <- solution_plot_data(object, columns, directions, passenger, destination, step)
  data$q <- q_of_cells(object$q, state_numbers(object$model$observation_space), data)
  picture <- if (is.null(data$columns)) {
    if (type == "q") q_cells(data) else value_points(data)
  } else {
    grid_picture(data, c(if (type == "q") q_layers(data) else value_layers(data), end_layers(data)))
  }
  subtitle <- paste(c(
    if (!is.null(object$actions)) "best",
    if (type == "q") "values of actions" else "values of states",
    if (is.null(object$actions)) "of a policy",
    if (!is.null(object$horizon)) paste("within", count_of(object$horizon, "step"))
  ), collapse = " ")
  picture +
    picture_labels(object$model$spec$id, c(subtitle, taxi_subtitle(data)), width = 40)
}

# Data ----------------------------------------------------------------------------

#' Compute the data of a plot of a solution
#' @return A list: `cells`, a data frame with a row for each state shown and the columns `state`,
#'   `value` (`NA` if no episode goes on there), `end` (`"goal"`, `"pit"`, or `""` for other
#'   states), `does` (the meaning of the action), and on a grid `row` and `column`; `directions`,
#'   one for each action; `columns` and `rows`, `NULL` without a grid; `walls` and `stands` of Taxi.
#' @noRd
solution_plot_data <- function(x, columns, directions, passenger, destination, step,
                               call = rlang::caller_env()) {
  check_count(step, max = x$horizon %||% 1, call = call)
  cells <- data.frame(
    state = state_numbers(x$model$observation_space), value = unname(x$values),
    action = if (is.null(x$actions)) NA else as.matrix(x$actions)[, step]
  )
  if (inherits(x$policy, "gym_policy_table")) {
    cells$action <- state_numbers(x$model$action_space)[best_column(x$policy$q)]
  }
  cells$action[row_max(x$q) == -Inf] <- NA
  moves <- ways_of(x$model)
  cells$end <- end_kinds(x$model, moves)
  cells$value[!moves$reached] <- NA
  placed <- place_states(
    cells, x$model$spec$id, x$model, columns, directions, passenger, destination, call, x$model
  )
  cells <- placed$cells
  cells$does[is.na(cells$value) | is.na(cells$does)] <- ""
  cells$ink <- ink_on(cells$value)
  cells$text <- number_texts(cells$value)
  placed$cells <- cells
  placed
}

# Is a terminal state a goal or a pit? The rewards on arrival decide.
end_kinds <- function(model, moves = ways_of(model)) {
  arrives <- moves$terminated & moves$reached[moves$from] & !moves$reached[moves$to]
  reward <- as.vector(tapply(
    moves$reward[arrives], factor(moves$to[arrives], seq_along(model$start)), max
  ))
  least <- if (length(unique(reward[!is.na(reward)])) > 1L) {
    max(reward, na.rm = TRUE)
  } else {
    mean(moves$reward[!moves$terminated])
  }
  ifelse(is.na(reward), "", ifelse(reward >= least, "goal", "pit"))
}

# The value of each action in each cell where episodes go on.
q_of_cells <- function(q, states, data) {
  cells <- data$cells[!is.na(data$cells$value), ]
  q <- q[match(cells$state, states), , drop = FALSE]
  most <- apply(q, 1L, max)
  each <- data.frame(
    cells[
      rep(seq_len(nrow(cells)), ncol(q)), intersect(c("state", "row", "column"), names(cells)),
      drop = FALSE
    ],
    direction = rep(data$directions, each = nrow(cells)),
    action = rep(data$numbers, each = nrow(cells)), q = as.vector(q),
    # Rounding may make equal values differ.
    best = as.vector(q >= most - 1e-9 * pmax(1, abs(most))), row.names = NULL
  )
  each[is.finite(each$q), ]
}

# Layers --------------------------------------------------------------------------

value_layers <- function(data) {
  cells <- data$cells[!is.na(data$cells$value), ]
  size <- text_size(data, cells$text)
  # Write values below the actions, if there are any.
  below <- if (any(nzchar(cells$does))) 0.3 else 0
  c(
    list(cell_tiles(ggplot2::aes(fill = .data$value), cells), value_fill()),
    action_layers(data, cells, above = if (size > 0) 0.15 else 0),
    if (size > 0) {
      ggplot2::geom_text(
        ggplot2::aes(label = .data$text), cells, nudge_y = -below, size = size, colour = cells$ink
      )
    }
  )
}

value_fill <- function() continuous_fill("value", value_colours())

# An action's triangle has three corners: the middle of the cell, and both ends of the side to which
# the action leads.
q_layers <- function(data) {
  moves <- data$q[data$q$direction %in% names(arrow_steps), ]
  moves$cell <- seq_len(nrow(moves))
  step <- matrix(as.numeric(unlist(arrow_steps[moves$direction])), ncol = 2L, byrow = TRUE)
  along <- 0.5 * step
  across <- 0.5 * step[, 2:1, drop = FALSE]
  corner <- function(sign) {
    data.frame(moves, x = moves$column + along[, 1L] + sign * across[, 1L],
               y = moves$row + along[, 2L] + sign * across[, 2L])
  }
  corners <- rbind(data.frame(moves, x = moves$column, y = moves$row), corner(1), corner(-1))
  moves$x <- moves$column + 0.3 * step[, 1L]
  moves$y <- moves$row + 0.34 * step[, 2L]
  moves$text <- number_texts(moves$q)
  moves$ink <- ink_on(moves$q)
  # Two numbers must fit side by side.
  size <- text_size(data, strrep("0", 2 * nchar(moves$text) + 3))
  c(
    list(
      ggplot2::geom_polygon(
        ggplot2::aes(.data$x, .data$y, group = .data$cell, fill = .data$q), corners,
        colour = "grey80", linewidth = 0.2
      ),
      value_fill(), cell_tiles(data = unique(moves[c("row", "column")]), fill = NA)
    ),
    if (size > 0) {
      ggplot2::geom_text(
        ggplot2::aes(
          .data$x, .data$y, label = .data$text, fontface = ifelse(.data$best, "bold", "plain")
        ),
        moves, size = size, colour = moves$ink
      )
    }
  )
}

end_layers <- function(data) {
  ends <- data$cells[data$cells$end != "", ]
  ends$kind <- ends$end
  c(
    list(cell_tiles(data = ends, fill = "white")),
    marked_points(ends, size = 0.45 * cell_width(data))
  )
}

# Draws points with the mark of their `kind`, and the key.
marked_points <- function(points, size) {
  marks <- list(
    value = key_mark("blue", shape = 16), goal = key_mark("green", shape = 18),
    pit = key_mark("ink", shape = 16)
  )
  marks <- marks[names(marks) %in% points$kind]
  if (length(marks)) {
    list(
      ggplot2::geom_point(
        ggplot2::aes(colour = .data$kind, shape = .data$kind), points, size = size
      ),
      ggplot2::scale_shape_manual(
        values = vapply(marks, function(mark) mark$shape, 0), guide = "none"
      ),
      key_of_marks(marks)
    )
  }
}

# Without a grid ------------------------------------------------------------------

value_points <- function(data) {
  cells <- data$cells
  cells$value[cells$end != ""] <- 0
  cells$kind <- ifelse(cells$end == "", "value", cells$end)
  cells$panel <- "value"
  taken <- cells[nzchar(cells$does), ]
  taken$value <- taken$action
  taken$panel <- rep(action_panel(data), nrow(taken))
  points <- rbind(cells, taken)
  points$panel <- factor(points$panel, unique(points$panel))
  ggplot2::ggplot(points, ggplot2::aes(.data$state, .data$value)) +
    marked_points(points[!is.na(points$value), ], size = 2) +
    (if (nrow(taken)) {
      list(
        ggplot2::facet_wrap(
          ggplot2::vars(.data$panel), ncol = 1L, scales = "free_y", labeller = wrapped_strips(1)
        ),
        # The last of the points are of the actions.
        ggplot2::geom_blank(
          data = replace(points[rep(nrow(points), 2L), ], "value", range(data$numbers))
        )
      )
    }) +
    state_axis(data$states) +
    ggplot2::scale_y_continuous(breaks = few_breaks) +
    ggplot2::labs(x = "state", y = if (!nrow(taken)) "value") +
    theme_gym()
}

# The title of the panel of actions, with the names of a few.
action_panel <- function(data) {
  named <- length(data$numbers) <= most_named_actions && any(data$directions != data$numbers)
  paste0("action", if (named) paste0(" (", toString(paste(data$numbers, data$directions)), ")"))
}

# Draws the value of each action in each state, with a row for each action.
q_cells <- function(data) {
  ggplot2::ggplot(data$q, ggplot2::aes(.data$state, .data$action)) +
    ggplot2::geom_tile(ggplot2::aes(fill = .data$q), width = 1, height = 1) +
    ggplot2::geom_point(
      ggplot2::aes(colour = "best action"), data$q[data$q$best, ], shape = 21, fill = "white",
      size = 1.2
    ) +
    value_fill() +
    key_of_marks(list(`best action` = key_mark("ink", shape = 21))) +
    state_axes(data)
}

# Makes the axes of states and actions. If there are few actions, the axis shows their names.
state_axes <- function(data) {
  few <- length(data$numbers) <= most_named_actions
  names <- ifelse(data$directions == data$numbers, data$labels, data$directions)
  list(
    state_axis(data$states),
    ggplot2::scale_y_continuous(
      breaks = if (few) data$numbers else few_breaks,
      labels = if (few) broken_texts(names, 24) else ggplot2::waiver()
    ),
    ggplot2::labs(x = "state", y = "action"), theme_gym()
  )
}
