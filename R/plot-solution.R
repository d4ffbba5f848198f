#' Plot the values of a solved model
#'
#' Shows what each state is worth as a colour, which is darker the less it is, and the action that
#' is taken there as an arrow or a letter: on the lake of FrozenLake, beside the cliff of
#' CliffWalking, on the grid of Taxi for one passenger and destination, and on any other grid whose
#' `columns` are given. States at which episodes are over have a cross, and those in which none ever
#' is are grey. Other models have a point for each state.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object What [solve_mdp()] returned.
#' @param columns How many columns the grid has, where states are numbered row by row from the upper
#'   left; `NULL`, the default, for what is known of the environment.
#' @param directions What each action does on the grid, strings in the order of the actions:
#'   `"left"`, `"right"`, `"up"`, `"down"`, or a letter to write. `NULL`, the default, for what is
#'   known of the environment.
#' @param passenger,destination Of Taxi: where the passenger is, from 0 to 3 for the stands R, G, Y
#'   and B, or 4 for the taxi; and the stand that is the destination, from 0 to 3. The default is a
#'   passenger at Y who goes to R.
#' @param step Of a solution with a horizon: the step whose actions are shown, from 1, the default.
#' @param main The title; `NULL`, the default, names the environment.
#' @param ... Not used.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @export
#' @examples
#' # Four by three fields; the upper right one is the goal.
#' fields <- expand.grid(action = 0:3, state = setdiff(0:11, 3))
#' row <- fields$state %/% 4 + c(0, 1, 0, -1)[fields$action + 1]
#' column <- fields$state %% 4 + c(-1, 0, 1, 0)[fields$action + 1]
#' outside <- row < 0 | row > 2 | column < 0 | column > 3
#' fields$next_state <- ifelse(outside, fields$state, 4 * row + column)
#' fields$reward <- -1
#' solved <- solve_mdp(gym_model(fields, start = 8, id = "Four by three"))
#' plot(solved, columns = 4, directions = c("left", "down", "right", "up"))
#'
#' @examplesIf gym:::can_start_server()
#' plot(solve_mdp("FrozenLake-v1"))
#' plot(solve_mdp("Taxi-v4"), passenger = 2, destination = 0)
plot.gym_solution <- function(x, columns = NULL, directions = NULL, passenger = 2, destination = 0,
                              step = 1, main = NULL, ...) {
  check_dots_empty(...)
  data <- solution_plot_data(x, columns, directions, passenger, destination, step)
  if (is.null(data$columns)) draw_state_points(data) else draw_state_grid(data)
  title_above(main %||% data$title)
  invisible(x)
}

# Data ----------------------------------------------------------------------------

# What the actions of Gymnasium's grids do, by the beginnings of their ids; see their documentation,
# https://gymnasium.farama.org/environments/toy_text/.
known_directions <- list(
  FrozenLake = c("left", "down", "right", "up"),
  CliffWalking = c("up", "right", "down", "left"),
  Taxi = c("down", "up", "right", "left", "P", "D")
)

taxi_stands <- data.frame(
  label = c("R", "G", "Y", "B"), row = c(1, 1, 5, 5), column = c(1, 5, 1, 4)
)

#' Compute what a plot of a solution shows
#' @return A list: `cells`, a data frame with a row for each state that is shown and the columns
#'   `state`, `value` (`NA` where no episode ever is), `text` (the value), `ends` (are episodes over
#'   there?), `does` (what the action does), and on a grid `row` and `column`; `columns` and `rows`,
#'   `NULL` without a grid; `walls` and `stands` of Taxi; `title`.
#' @noRd
solution_plot_data <- function(x, columns, directions, passenger, destination, step,
                               call = rlang::caller_env()) {
  check_count(columns, allow_null = TRUE, call = call)
  check_count(step, max = x$horizon %||% 1, call = call)
  cells <- as.data.frame(x)
  if (is.matrix(x$actions)) cells$action <- x$actions[, step]
  if (inherits(x$policy, "gym_policy_table")) {
    cells$action <- state_numbers(x$model$action_space)[best_column(x$policy$q)]
  }
  known <- known_grid(x$model$spec$id)
  directions <- check_directions(
    directions %||% known_directions[[known]], ncol(x$q), call
  )
  cells$text <- vapply(cells$value, function(value) format(signif(value, 3L)), "")
  kinds <- state_kinds(x$model)
  cells$ends <- kinds$ends
  # Nothing comes after the end, whatever the model says of moves from there.
  cells$value[kinds$ends] <- 0
  cells$value[!kinds$reached & !kinds$ends] <- NA
  place <- match(cells$action, state_numbers(x$model$action_space))
  cells$does <- (directions %||% state_numbers(x$model$action_space))[place]
  cells$does[cells$ends | is.na(cells$value)] <- ""
  cells$does[is.na(cells$does)] <- ""
  finite <- cells$value[is.finite(cells$value)]
  data <- list(title = solution_title(x), key = if (length(finite)) range(finite) else c(0, 0))
  if (known == "Taxi" && is.null(columns)) {
    return(c(data, taxi_cells(cells, passenger, destination, taxi_walls(x$model), call)))
  }
  c(data, grid_cells(cells, columns %||% if (known != "") grid_columns(x$model), call))
}

# Puts states into rows and columns, where it is known how many columns there are.
grid_cells <- function(cells, columns, call) {
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

solution_title <- function(x) {
  whose <- if (is.null(x$actions)) "values of a policy" else "best values"
  within <- if (!is.null(x$horizon)) paste("within", count_of(x$horizon, "step"))
  paste(c(x$model$spec$id, paste(c(whose, within), collapse = " ")), collapse = ", ")
}

# Which of Gymnasium's grids it is, "" for none of them.
known_grid <- function(id) {
  found <- names(known_directions)[startsWith(id, names(known_directions))]
  if (length(found)) found else ""
}

check_directions <- function(directions, count, call) {
  if (!is.null(directions) && (!is.character(directions) || length(directions) != count)) {
    must <- paste("a string for each of", count_of(count, "action"))
    abort_argument(directions, must, "directions", call)
  }
  directions
}

#' What the states are: those that episodes go through, those in which they are over, and others
#'
#' @return A list of two logical vectors: `reached`, the states that episodes can be in when an
#'   action is chosen, and `ends`, those of the others that end an episode when one arrives there.
#' @noRd
state_kinds <- function(model) {
  table <- model$transitions
  table <- table[table$probability > 0, ]
  from <- state_rows(model, table$state)
  to <- state_rows(model, table$next_state)
  goes_on <- !table$terminated
  one_of <- function(rows) seq_along(model$start) %in% rows
  reached <- closure(function(reached) one_of(to[goes_on & reached[from]]), model$start > 0)
  list(reached = reached, ends = one_of(to[!goes_on & reached[from]]) & !reached)
}

# A step down adds as many to the state's number as there are columns: the most common difference
# above 1.
grid_columns <- function(model) {
  further <- with(model$transitions, next_state - state)
  further <- further[further > 1L]
  if (length(further)) as.integer(names(which.max(table(further))))
}

# The states of Taxi number the row, the column, the passenger and the destination, see its
# documentation.
taxi_cells <- function(cells, passenger, destination, walls, call) {
  check_count(passenger, min = 0, max = 4, call = call)
  check_count(destination, min = 0, max = 3, call = call)
  state <- cells$state
  shown <- state %/% 4L %% 5L == passenger & state %% 4L == destination
  cells$row <- state %/% 100L + 1L
  cells$column <- state %/% 20L %% 5L + 1L
  cells <- cells[shown, ]
  list(
    cells = cells, columns = 5L, rows = 5L,
    walls = cells[cells$column < 5L & cells$state %in% walls, c("row", "column")],
    stands = taxi_stands, from = passenger, to = destination
  )
}

# The states from which a move to the right stays in its place.
taxi_walls <- function(model) {
  right <- model$transitions[model$transitions$action == 2L, ]
  right$state[right$state == right$next_state & right$probability == 1]
}

# Drawing ---------------------------------------------------------------------------

value_palette <- function(n = 101L) grDevices::hcl.colors(n, "viridis")

# The colours of values, and those of what is written on them.
cell_colours <- function(data) {
  if (!is.null(data$fill)) {
    return(list(fill = data$fill, ink = rep("black", nrow(data$cells))))
  }
  span <- diff(data$key)
  share <- if (span > 0) (data$cells$value - data$key[[1L]]) / span else rep(1, nrow(data$cells))
  share <- pmin(pmax(share, 0), 1)
  fill <- value_palette()[round(share * 100) + 1L]
  list(
    fill = ifelse(is.na(fill), "grey92", fill),
    ink = ifelse(share < 0.6, "white", "black")
  )
}

draw_state_grid <- function(data) {
  cells <- data$cells
  old <- graphics::par(mar = c(1, 1, 3, 1))
  on.exit(graphics::par(old))
  graphics::plot(
    c(0.5, data$columns + 0.5), c(0.5, data$rows + 0.5), type = "n", asp = 1, axes = FALSE,
    xlab = "", ylab = "", ylim = c(data$rows + 0.5, 0.5)
  )
  colours <- cell_colours(data)
  graphics::rect(
    cells$column - 0.5, cells$row - 0.5, cells$column + 0.5, cells$row + 0.5, col = colours$fill,
    border = "grey80"
  )
  over <- cells$ends
  graphics::points(cells$column[over], cells$row[over], pch = 4L, cex = 2, col = colours$ink[over])
  draw_actions(cells, colours$ink)
  cex <- min(1, 9 / max(data$columns, data$rows))
  shown <- !over & !is.na(cells$value)
  if (any(shown)) {
    graphics::text(
      cells$column[shown], cells$row[shown] + 0.33, cells$text[shown], cex = 0.7 * cex,
      col = colours$ink[shown]
    )
  }
  draw_taxi(data)
}

arrow_steps <- list(left = c(-1, 0), right = c(1, 0), up = c(0, -1), down = c(0, 1))

draw_actions <- function(cells, ink) {
  moves <- cells$does %in% names(arrow_steps)
  if (any(moves)) {
    step <- do.call(rbind, arrow_steps[cells$does[moves]])
    x <- cells$column[moves]
    y <- cells$row[moves] - 0.1
    graphics::arrows(
      x - 0.2 * step[, 1L], y - 0.2 * step[, 2L], x + 0.2 * step[, 1L], y + 0.2 * step[, 2L],
      length = 0.06, lwd = 1.5, col = ink[moves]
    )
  }
  named <- !moves & nzchar(cells$does)
  if (any(named)) {
    graphics::text(cells$column[named], cells$row[named] - 0.1, cells$does[named],
                   col = ink[named], font = 2L)
  }
}

draw_taxi <- function(data) {
  if (is.null(data$stands)) {
    return(invisible())
  }
  graphics::segments(
    data$walls$column + 0.5, data$walls$row - 0.5, data$walls$column + 0.5, data$walls$row + 0.5,
    lwd = 4, lend = "butt", col = "black"
  )
  stand <- data$stands
  graphics::text(stand$column - 0.38, stand$row - 0.38, stand$label, cex = 0.8, font = 2L,
                 col = okabe_ito$orange)
  where <- if (data$from == 4) "in the taxi" else paste("at", stand$label[[data$from + 1L]])
  graphics::mtext(
    paste0("passenger ", where, ", destination ", stand$label[[data$to + 1L]],
           "; P picks up, D drops off"),
    side = 1L, cex = 0.8
  )
}

draw_state_points <- function(data) {
  cells <- data$cells
  open_plot(
    list(x = range(cells$state), y = data$key, xlab = "state", ylab = "value",
         xlim = range(cells$state), ylim = data$key),
    list()
  )
  graphics::points(cells$state, cells$value, pch = ifelse(cells$ends, 4L, 16L),
                   col = okabe_ito$blue)
  graphics::text(cells$state, cells$value, cells$does, pos = 3L, cex = 0.8, xpd = NA)
}

# With ggplot2 ------------------------------------------------------------------------

#' @rdname plot.gym_solution
#' @exportS3Method ggplot2::autoplot
autoplot.gym_solution <- function(object, ..., columns = NULL, directions = NULL, passenger = 2,
                                  destination = 0, step = 1) {
  check_dots_empty(...)
  data <- solution_plot_data(object, columns, directions, passenger, destination, step)
  cells <- data$cells
  cells$does <- with_arrow_signs(cells$does)
  cells$does[cells$ends] <- "\u00d7"
  cells$text[is.na(cells$value)] <- ""
  cells$ink <- cell_colours(data)$ink
  if (is.null(data$columns)) {
    return(
      ggplot2::ggplot(cells, ggplot2::aes(x = .data$state, y = .data$value)) +
        ggplot2::geom_point(colour = okabe_ito$blue) +
        ggplot2::geom_text(ggplot2::aes(label = .data$does), vjust = -0.8) +
        ggplot2::labs(x = "state", y = "value", title = data$title)
    )
  }
  ggplot2::ggplot(cells, ggplot2::aes(x = .data$column, y = .data$row)) +
    ggplot2::geom_tile(ggplot2::aes(fill = .data$value), colour = "grey80") +
    ggplot2::geom_text(ggplot2::aes(label = .data$does), colour = cells$ink, nudge_y = 0.1) +
    ggplot2::geom_text(ggplot2::aes(label = .data$text), colour = cells$ink, size = 2.5,
                       nudge_y = -0.3) +
    ggplot2::scale_fill_gradientn(colours = value_palette(), na.value = "grey92") +
    ggplot2::scale_y_reverse() +
    ggplot2::coord_fixed() +
    ggplot2::theme_void() +
    ggplot2::labs(title = data$title)
}

with_arrow_signs <- function(does) {
  signs <- c(left = "\u2190", right = "\u2192", up = "\u2191", down = "\u2193")
  known <- does %in% names(signs)
  does[known] <- signs[does[known]]
  does
}
