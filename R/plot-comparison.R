# Several policies in one picture: a row for each with the distribution of its returns.

# More rows than this could not be told apart.
most_rows <- 10L

comparison_picture <- function(rollouts) {
  data <- comparison_plot_data(rollouts)
  rows <- data$rows
  ggplot2::ggplot(data$shapes, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_polygon(
      ggplot2::aes(
        group = interaction(.data$label, .data$area), fill = .data$label, colour = .data$label
      ),
      alpha = 0.4
    ) +
    ggplot2::geom_segment(
      ggplot2::aes(
        .data$value, .data$y - 0.09, xend = .data$value, yend = .data$y - 0.02,
        colour = .data$label
      ),
      data$returns
    ) +
    ggplot2::geom_segment(
      ggplot2::aes(.data$median, .data$y, xend = .data$median, yend = .data$y + 0.75), rows,
      linetype = "dashed", linewidth = 0.8, colour = gym_colours[["ink"]]
    ) +
    ggplot2::scale_fill_manual(
      values = named_colours(rows$label), aesthetics = c("fill", "colour"), guide = "none"
    ) +
    # The medians are at the right side, where they cannot overlap.
    ggplot2::scale_y_continuous(
      breaks = rows$y, labels = vapply(as.character(rows$label), broken_text, "", width = 20),
      sec.axis = ggplot2::dup_axis(labels = paste("median", number_text_each(rows$median)))
    ) +
    ggplot2::scale_x_continuous(breaks = data$marks %||% ggplot2::waiver()) +
    picture_labels(data$title, data$subtitle, x = returns_label, y = NULL) +
    theme_gym() +
    ggplot2::theme(axis.title.y.right = ggplot2::element_blank())
}

#' Compute the data of a plot of several policies
#' @param rollouts A list of rollouts with names.
#' @return A list: `rows`, a data frame with a row for each policy, from the top: `label`, `y` (the
#'   place of the row), `median`; `returns`, `shapes`, data frames with a column `label`: the
#'   returns (`value`), and the corners of the areas (`x`, `y`, and `area`, the number of the area);
#'   `marks`, the places of bars on the axis, if all rows are bars; `title`, `subtitle`.
#' @noRd
comparison_plot_data <- function(rollouts) {
  groups <- unlist(unname(Map(candidate_returns, rollouts, names(rollouts), length(rollouts) > 1L)),
                   recursive = FALSE)
  shown <- shown_groups(groups)
  each <- lapply(shown, returns_plot_data)
  bars <- equal_bars(lapply(each, function(data) data$bars), range(unlist(shown)))
  y <- rev(seq_along(shown)) - 1
  # In the order of the rows, which is that of the colours.
  label <- factor(names(shown), names(shown))
  counts <- unique(range(lengths(shown)))
  list(
    rows = data.frame(
      label = label, y = y, median = vapply(each, function(data) data$median, 0), row.names = NULL
    ),
    returns = data.frame(
      label = rep(label, lengths(shown)), y = rep(y, lengths(shown)),
      value = unlist(shown, use.names = FALSE)
    ),
    shapes = do.call(rbind, Map(row_shapes, label, y, each, bars)),
    marks = if (!any(vapply(bars, is.null, NA))) bar_marks(unique(do.call(rbind, bars)["value"])),
    title = paste(unique(vapply(rollouts, function(x) x$env_id, "")), collapse = ", "),
    subtitle = c(
      if (length(shown) < length(groups)) {
        paste("the", length(shown), "of", length(groups), "policies with the highest mean returns")
      },
      paste(paste(vapply(counts, whole_number_text, ""), collapse = " to "), "episodes each")
    )
  )
}

#' Split the returns of a rollout by candidate
#' @param label The rollout's name.
#' @param several Whether there are other rollouts.
#' @return A list of numeric vectors with names.
#' @noRd
candidate_returns <- function(x, label, several) {
  candidate <- x$episodes$candidate
  if (is.null(candidate)) {
    return(stats::setNames(list(x$episodes$return), label))
  }
  each <- split(x$episodes$return, candidate)
  names <- candidate_names(x$policy)[as.integer(names(each))] %||% names(each)
  stats::setNames(each, if (several) paste(label, names) else names)
}

# All groups, or of many those with the highest mean returns.
shown_groups <- function(groups) {
  if (length(groups) <= most_rows) {
    return(groups)
  }
  groups[order(-vapply(groups, mean, 0))[seq_len(most_rows)]]
}

# The bars of all rows have the same width, which the two nearest values determine.
equal_bars <- function(each, across) {
  values <- unique(unlist(lapply(each, function(bars) bars$value)))
  half <- if (length(values)) bar_half(values, diff(across))
  lapply(each, function(bars) {
    if (!is.null(bars)) {
      bars$xmin <- bars$value - half
      bars$xmax <- bars$value + half
    }
    bars
  })
}

# The areas of a row: one below a density, or one for each bar. All rows have the same height.
row_shapes <- function(label, y, data, bars) {
  height <- 0.75
  if (is.null(bars)) {
    density <- data$density
    n <- nrow(density)
    x <- density$x[c(1L, seq_len(n), n)]
    high <- c(0, density$y, 0)
    area <- 1L
  } else {
    x <- as.vector(rbind(bars$xmin, bars$xmin, bars$xmax, bars$xmax))
    high <- as.vector(rbind(0, bars$episodes, bars$episodes, 0))
    area <- rep(seq_len(nrow(bars)), each = 4L)
  }
  data.frame(label = label, area = area, x = x, y = y + height * high / max(high),
             row.names = NULL)
}
