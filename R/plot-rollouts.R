# Several policies in one picture: a row for each, with the distribution of its returns.

# More rows than this could not be told apart.
most_rows <- 10L

#' Tell the rollouts among the arguments of a plot from the others
#' @param dots The arguments, a list; `written` the call of list() with what the caller wrote.
#' @return A list: `rollouts`, with names, and `others`, what is left of the arguments.
#' @noRd
given_rollouts <- function(dots, written, call = rlang::caller_env()) {
  are <- vapply(dots, inherits, NA, "gym_rollout")
  names <- rlang::names2(dots)
  unnamed <- which(!are & !nzchar(names))
  if (length(unnamed)) {
    gym_abort(
      paste0("Beside rollouts, the arguments of a plot need names, such as ",
             "`type = \"trajectory\"`, which ", describe_argument(dots[[unnamed[[1L]]]]),
             " has not."),
      class = "gym_error_argument", argument = "...", value = dots[[unnamed[[1L]]]], call = call
    )
  }
  check_have_episodes(dots[are], call)
  labels <- argument_labels(
    dots[are], names[are], as.list(written)[-1L][are], function(x) policy_label(x$policy)
  )
  list(rollouts = stats::setNames(dots[are], labels), others = dots[!are])
}

check_have_episodes <- function(rollouts, call) {
  for (rollout in rollouts) {
    if (!nrow(rollout$episodes)) {
      gym_abort(
        c(paste0("A rollout in ", rollout$env_id, " has no episode to plot: it was interrupted ",
                 "before the first batch of episodes had ended."),
          i = "The same call of `rollout()` with its `seed` plays it again."),
        class = "gym_error_argument", argument = "x", value = rollout, call = call
      )
    }
  }
}

# Those without a name are called as their variable, or by `label_of`.
argument_labels <- function(values, names, expressions, label_of) {
  labels <- vapply(seq_along(values), function(i) {
    if (nzchar(names[[i]])) {
      names[[i]]
    } else if (is.name(expressions[[i]])) {
      as.character(expressions[[i]])
    } else {
      label_of(values[[i]])
    }
  }, "")
  make.unique(labels, " ")
}

check_single_rollout <- function(rollouts, type, call = rlang::caller_env()) {
  if (length(rollouts) > 1L) {
    gym_abort(
      paste0("A ", type, " shows one rollout, not ", length(rollouts), "."),
      class = "gym_error_argument", argument = "...", call = call
    )
  }
}

is_comparison <- function(rollouts) {
  length(rollouts) > 1L || !is.null(rollouts[[1L]]$episodes$candidate)
}

#' Compute what a plot of several policies shows
#' @param rollouts A list of rollouts with names.
#' @return A list: `rows`, a data frame with a row for each policy, from the top: `label`, `y`
#'   (where its row stands), `median`, `text`, `place` (where the median is along the axis, from 0
#'   to 1), `colour`; `returns`, `shapes`, data frames with a column
#'   `label`: the returns (`value`), and the corners of the areas (`x`, `y`, and `area`, which tells
#'   them apart); `xlim`, `ylim`, `title`.
#' @noRd
comparison_plot_data <- function(rollouts) {
  groups <- unlist(unname(Map(candidate_returns, rollouts, names(rollouts), length(rollouts) > 1L)),
                   recursive = FALSE)
  shown <- shown_groups(groups)
  each <- lapply(shown, returns_plot_data)
  bars <- equal_bars(lapply(each, function(data) data$bars), range(unlist(shown)))
  xlim <- range(unlist(shown), unlist(lapply(bars, function(bars) c(bars$xmin, bars$xmax))))
  medians <- vapply(each, function(data) data$median, 0)
  y <- rev(seq_along(shown)) - 1
  list(
    rows = data.frame(
      label = names(shown), y = y, median = medians, text = vapply(each, median_label, ""),
      place = (medians - xlim[[1L]]) / diff(xlim),
      colour = rep_len(setdiff(line_colours, okabe_ito$vermillion), length(shown)),
      row.names = NULL
    ),
    returns = data.frame(
      label = rep(names(shown), lengths(shown)), y = rep(y, lengths(shown)),
      value = unlist(shown, use.names = FALSE)
    ),
    shapes = do.call(rbind, Map(row_shapes, names(shown), y, each, bars)),
    xlim = xlim,
    ylim = c(-0.15, length(shown)),
    title = comparison_title(rollouts, length(shown), length(groups))
  )
}

#' Take the returns of a rollout apart by candidate
#' @param label The rollout's name; `several`, whether there are other rollouts.
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

# All of few, otherwise those with the highest mean returns.
shown_groups <- function(groups) {
  if (length(groups) <= most_rows) {
    return(groups)
  }
  groups[order(-vapply(groups, mean, 0))[seq_len(most_rows)]]
}

comparison_title <- function(rollouts, shown, all) {
  ids <- unique(vapply(rollouts, function(x) x$env_id, ""))
  count <- if (shown < all) {
    paste("the", shown, "of", all, "policies with the highest mean returns")
  } else {
    paste(all, if (all == 1L) "policy" else "policies")
  }
  paste(c(ids, count), collapse = ", ")
}

# The bars of all rows are equally wide: as the two nearest values of all allow, and not too narrow
# to be seen.
equal_bars <- function(each, across) {
  values <- sort(unique(unlist(lapply(each, function(bars) bars$value))))
  half <- if (length(values) == 1L) {
    0.2 * around(values)
  } else if (length(values)) {
    max(0.4 * min(diff(values)), diff(across) / 150)
  }
  lapply(each, function(bars) {
    if (!is.null(bars)) {
      bars$xmin <- bars$value - half
      bars$xmax <- bars$value + half
    }
    bars
  })
}

# The areas of a row: one under a density, or one for each bar. The highest point of each row is as
# high as that of every other.
row_shapes <- function(label, y, data, bars) {
  height <- 0.66
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

plot_comparison <- function(rollouts, main, xlab, ylab, chosen) {
  data <- comparison_plot_data(rollouts)
  rows <- data$rows
  cex <- label_size(rows$label)
  margin <- cex / graphics::par("cex.axis") * max(label_inches(rows$label)) +
    graphics::par("csi") * if (is.null(ylab)) 1 else 2.5
  old <- graphics::par(mai = replace(graphics::par("mai"), 2L, margin))
  on.exit(graphics::par(old))
  open_plot(
    list(x = data$xlim, y = data$ylim, main = main %||% data$title, xlab = xlab %||% returns_label,
         ylab = ylab %||% "", yaxs = "i", yaxt = "n"),
    chosen
  )
  if ("yaxt" %in% own_axes(chosen)) {
    graphics::axis(2L, at = rows$y, labels = rows$label, las = 1L, tick = FALSE, cex.axis = cex)
  }
  for (i in seq_len(nrow(rows))) {
    draw_row(rows[i, ], data)
  }
}

# The labels take at most a third of the width.
label_size <- function(labels) {
  room <- graphics::par("fin")[[1L]] / 3 / max(label_inches(labels))
  graphics::par("cex.axis") * min(1, room)
}

# There is no plot yet in which strwidth() could measure: letters are half as wide as high.
label_inches <- function(labels) 0.5 * (nchar(labels) + 1) * graphics::par("csi")

draw_row <- function(row, data) {
  shapes <- data$shapes[data$shapes$label == row$label, ]
  for (area in split(shapes, shapes$area)) {
    graphics::polygon(area$x, area$y, border = row$colour, lwd = 2,
                      col = grDevices::adjustcolor(row$colour, 0.35))
  }
  values <- data$returns$value[data$returns$label == row$label]
  graphics::segments(values, row$y - 0.09, values, row$y - 0.02, col = row$colour)
  graphics::segments(row$median, row$y, row$median, row$y + 0.7, col = okabe_ito$vermillion,
                     lwd = 2, lty = "dashed")
  graphics::text(row$median, row$y + 0.82, row$text, adj = c(row$place, 0.5), xpd = NA, cex = 0.85,
                 col = okabe_ito$vermillion)
}

# With ggplot2 -------------------------------------------------------------------------

autoplot_comparison <- function(rollouts) {
  data <- comparison_plot_data(rollouts)
  rows <- data$rows
  colours <- stats::setNames(rows$colour, rows$label)
  ggplot2::ggplot(data$shapes, ggplot2::aes(x = .data$x, y = .data$y)) +
    ggplot2::geom_polygon(
      ggplot2::aes(group = interaction(.data$label, .data$area), fill = .data$label,
                   colour = .data$label),
      alpha = 0.35
    ) +
    ggplot2::geom_segment(
      ggplot2::aes(x = .data$value, xend = .data$value, y = .data$y - 0.09, yend = .data$y - 0.02,
                   colour = .data$label),
      data = data$returns
    ) +
    ggplot2::geom_segment(
      ggplot2::aes(x = .data$median, xend = .data$median, y = .data$y, yend = .data$y + 0.7),
      data = rows, colour = okabe_ito$vermillion, linetype = "dashed"
    ) +
    ggplot2::geom_text(
      ggplot2::aes(x = .data$median, y = .data$y + 0.82, label = .data$text, hjust = .data$place),
      data = rows, colour = okabe_ito$vermillion, size = 3
    ) +
    ggplot2::scale_fill_manual(values = colours, guide = "none") +
    ggplot2::scale_colour_manual(values = colours, guide = "none") +
    ggplot2::scale_y_continuous(breaks = rows$y, labels = rows$label, minor_breaks = NULL) +
    ggplot2::labs(x = returns_label, y = NULL, title = data$title)
}
