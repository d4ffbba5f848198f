# Draws states on a grid: finds their places and what to draw in their cells.

# Draws cells, which have the columns `row` and `column`. `layers` come below the environment's
# marks. If the cells are parts of an observation, two parts have axes and the others have panels.
grid_picture <- function(data, layers) {
  axes <- data$axes
  picture <- ggplot2::ggplot(data$cells, ggplot2::aes(.data$column, .data$row)) +
    layers +
    taxi_layers(data) +
    (if (length(data$panels)) ggplot2::facet_wrap(data$panels, labeller = ggplot2::label_both))
  if (isTRUE(data$has_axes)) {
    return(
      picture +
        ggplot2::scale_x_continuous(breaks = few_breaks, expand = c(0, 0)) +
        ggplot2::scale_y_continuous(breaks = few_breaks, expand = c(0, 0)) +
        theme_gym()
    )
  }
  named <- function(mark) if (is.null(axes)) ggplot2::waiver() else mark
  picture <- picture +
    ggplot2::scale_x_continuous(
      breaks = named(seq_along(axes[[2L]])), labels = named(as.character(axes[[2L]])),
      expand = c(0.01, 0)
    ) +
    ggplot2::scale_y_reverse(
      breaks = named(seq_along(axes[[1L]])), labels = named(as.character(axes[[1L]])),
      expand = c(0.01, 0)
    ) +
    ggplot2::coord_fixed()
  if (is.null(axes)) {
    # The key fits beside a square grid, or above a wide one.
    place <- if (data$columns > 1.5 * data$rows) "top" else "right"
    picture + theme_gym_bare() + ggplot2::theme(legend.position = place)
  } else {
    picture +
      ggplot2::labs(x = names(axes)[[2L]], y = names(axes)[[1L]]) +
      theme_gym() +
      ggplot2::theme(panel.grid = ggplot2::element_blank())
  }
}

# The width of a square cell in millimetres, if the picture is four inches wide.
cell_width <- function(data) min(91 / data$columns, 56 / data$rows)

# Gives cells the size 1. Without a size, ggplot2 makes them as large as the distance between them.
cell_tiles <- function(mapping = NULL, ...) {
  ggplot2::geom_tile(mapping, ..., width = 1, height = 1, colour = "grey80", linewidth = 0.3)
}

# The largest text size for a cell, in millimetres; 0 if it would be too small to read.
text_size <- function(data, text) {
  cell <- cell_width(data)
  size <- min(3.2, 0.3 * cell, 0.85 * cell / (0.55 * max(nchar(text), 1L)))
  if (size < 1.5) 0 else size
}

arrow_steps <- list(left = c(-1, 0), right = c(1, 0), up = c(0, -1), down = c(0, 1))

#' Draw the action in each cell: an arrow for a direction, a letter otherwise
#' @param cells The cells, with the columns `does` and `ink`, the colour to draw with.
#' @param above How far above the middle to draw it, as a share of a cell's height.
#' @noRd
action_layers <- function(data, cells, above = 0) {
  cells$does <- as.character(cells$does)
  moves <- cells[cells$does %in% names(arrow_steps), ]
  step <- matrix(as.numeric(unlist(arrow_steps[moves$does])), ncol = 2L, byrow = TRUE)
  moves$x <- moves$column - 0.2 * step[, 1L]
  moves$y <- moves$row - above - 0.2 * step[, 2L]
  moves$xend <- moves$x + 0.4 * step[, 1L]
  moves$yend <- moves$y + 0.4 * step[, 2L]
  named <- cells[!cells$does %in% c(names(arrow_steps), ""), ]
  inches <- min(0.08, 0.7 / max(data$columns, data$rows))
  head <- ggplot2::arrow(length = ggplot2::unit(inches, "in"))
  list(
    ggplot2::geom_segment(
      ggplot2::aes(.data$x, .data$y, xend = .data$xend, yend = .data$yend), moves, arrow = head,
      colour = moves$ink, linewidth = 0.5
    ),
    ggplot2::geom_text(
      ggplot2::aes(label = .data$does), named, nudge_y = above, colour = named$ink,
      fontface = "bold", size = max(text_size(data, named$does), 2)
    )
  )
}

number_texts <- function(values) {
  largest <- max(abs(values[is.finite(values)]), 1e-6)
  # Show three digits. The small number makes 1 have as many decimals as 0.99.
  decimals <- max(0, 1 - floor(log10(largest) - 1e-6))
  ifelse(is.na(values), "", fixed_texts(values, decimals))
}

# Rounds numbers, and leaves out the minus sign of a number that is rounded to 0.
fixed_texts <- function(values, decimals) {
  sub("^-(0[.]?0*)$", "\\1", sprintf("%.*f", as.integer(decimals), values))
}

# White on dark colours, black on light ones.
ink_on <- function(values) {
  seen <- range(0, values[is.finite(values)])
  if (any(is.finite(values))) seen <- range(values, finite = TRUE)
  ifelse(is.na(values) | values >= seen[[1L]] + 0.6 * diff(seen), "black", "white")
}

# Where states stand ---------------------------------------------------------------------

# The directions of the actions on Gymnasium's grids, by the start of the environment's id; see
# https://gymnasium.farama.org/environments/toy_text/.
known_directions <- list(
  FrozenLake = c("left", "down", "right", "up"), CliffWalking = c("up", "right", "down", "left"),
  Taxi = c("down", "up", "right", "left", "P", "D")
)

taxi_stands <- data.frame(
  label = c("R", "G", "Y", "B"), row = c(1, 1, 5, 5), column = c(1, 5, 1, 4)
)

# The name of Gymnasium's grid that this environment is, or "".
known_grid <- function(id) {
  found <- names(known_directions)[startsWith(id %||% "", names(known_directions))]
  if (length(found)) found else ""
}

# Finds the places of states in Taxi's city or on a grid. `model` is the environment's model, if it
# is known.
place_states <- function(cells, env_id, spaces, columns, directions, passenger, destination, call,
                         model = NULL) {
  check_count(columns, allow_null = TRUE, call = call)
  known <- known_grid(env_id)
  numbers <- state_numbers(spaces$action_space)
  # Label actions by `directions`, otherwise as in the known grid, otherwise by their names or
  # numbers.
  directions <- directions %||% known_directions[[known]] %||% value_labels(spaces$action_space)
  if (!is.character(directions) || length(directions) != length(numbers)) {
    must <- paste("a string for each of", count_of(length(numbers), "action"))
    abort_argument(directions, must, "directions", call)
  }
  cells$does <- directions[match(cells$action, numbers)]
  values <- spaces$observation_space$values
  placed <- if (length(values) > 1L && is.null(columns)) {
    named_cells(cells, values)
  } else if (known == "Taxi" && is.null(columns)) {
    taxi_cells(cells, passenger, destination, model, call)
  } else {
    numbered_cells(cells, columns %||% grid_columns(known, nrow(cells), model), call)
  }
  c(placed, list(
    directions = directions, numbers = numbers, states = spaces$observation_space,
    labels = action_names(env_id, length(numbers), numbers[[1L]])
  ))
}

# The first column of names goes down, the second to the right, and others make panels.
named_cells <- function(cells, values) {
  axes <- lapply(values[1:2], function(x) if (is.factor(x)) levels(x) else sort(unique(x)))
  cells$row <- match(values[[1L]], axes[[1L]])
  cells$column <- match(values[[2L]], axes[[2L]])
  panels <- names(values)[-(1:2)]
  cells[panels] <- values[panels]
  list(cells = cells, rows = length(axes[[1L]]), columns = length(axes[[2L]]), axes = axes,
       panels = panels)
}

numbered_cells <- function(cells, columns, call) {
  if (is.null(columns)) {
    return(list(cells = cells))
  }
  count <- nrow(cells)
  if (count %% columns != 0) {
    must <- paste("a number by which", count_of(count, "state"), "make whole rows")
    abort_argument(columns, must, "columns", call)
  }
  cells$row <- (seq_len(count) - 1L) %/% columns + 1L
  cells$column <- (seq_len(count) - 1L) %% columns + 1L
  list(cells = cells, columns = columns, rows = count / columns)
}

# The number of columns of a known grid. A step down adds this number to the state, so it is the
# most common difference above 1 between two states.
grid_columns <- function(known, count, model) {
  if (!is.null(model) && known != "") {
    further <- model$transitions$next_state - model$transitions$state
    further <- further[further > 1L]
    if (length(further)) as.integer(names(which.max(table(further))))
  } else if (is.null(model)) {
    side <- sqrt(count)
    switch(known, CliffWalking = 12L, FrozenLake = if (side == trunc(side)) as.integer(side))
  }
}

# Makes the axis of states without a grid, with the states' names.
state_axis <- function(space) {
  if (is.null(space$values)) {
    return(ggplot2::scale_x_continuous(breaks = few_breaks))
  }
  ggplot2::scale_x_continuous(
    breaks = state_numbers(space), labels = value_labels(space),
    guide = ggplot2::guide_axis(check.overlap = TRUE)
  )
}

# Taxi's state number encodes the row, the column, the passenger and the destination, see
# Gymnasium's documentation of Taxi.
taxi_cells <- function(cells, passenger, destination, model, call) {
  check_count(passenger, min = 0, max = 4, call = call)
  check_count(destination, min = 0, max = 3, call = call)
  state <- cells$state
  shown <- state %/% 4L %% 5L == passenger & state %% 4L == destination
  cells$row <- state %/% 100L + 1L
  cells$column <- state %/% 20L %% 5L + 1L
  cells <- cells[shown, ]
  # There is a wall where a move to the right mostly stays in place; in the rain it may go aside.
  right <- model$transitions[model$transitions$action == 2L, ]
  walls <- right$state[right$state == right$next_state & right$probability > 0.5]
  list(
    cells = cells, columns = 5L, rows = 5L,
    walls = cells[cells$column < 5L & cells$state %in% walls, c("row", "column")],
    stands = taxi_stands, from = passenger, to = destination
  )
}

# The walls and the letters of the stands.
taxi_layers <- function(data) {
  if (is.null(data$stands)) {
    return(NULL)
  }
  right <- ggplot2::aes(
    .data$column + 0.5, .data$row - 0.5, xend = .data$column + 0.5, yend = .data$row + 0.5
  )
  list(
    ggplot2::geom_segment(right, data$walls, linewidth = 1.5, colour = "black"),
    ggplot2::geom_label(
      ggplot2::aes(.data$column - 0.35, .data$row - 0.35, label = .data$label), data$stands,
      size = 2.5, fontface = "bold", label.padding = ggplot2::unit(0.1, "lines")
    )
  )
}

taxi_subtitle <- function(data) {
  if (!is.null(data$stands)) {
    where <- c(paste("at", data$stands$label), "in the taxi")[[data$from + 1L]]
    c(paste0("passenger ", where, ", destination ", data$stands$label[[data$to + 1L]]),
      "P picks up, D drops off")
  }
}
