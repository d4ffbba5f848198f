# Several policies in one picture: a row for each with the distribution of its returns.

# More rows than this could not be told apart.
most_rows <- 10L

comparison_picture <- function(rollouts) {
  data <- comparison_plot_data(rollouts)
  returns <- data$returns
  ggplot2::ggplot(
    returns, ggplot2::aes(.data$value, fill = .data$label, colour = .data$label)
  ) +
    # All rows have the same height.
    ggplot2::geom_density(
      ggplot2::aes(y = ggplot2::after_stat(.data$scaled)), returns[!returns$few, ], trim = TRUE,
      alpha = 0.4
    ) +
    ggplot2::geom_bar(
      ggplot2::aes(y = ggplot2::after_stat(of_highest(.data$count, .data$PANEL))),
      returns[returns$few, ], width = bar_width(returns$value[returns$few], returns$value),
      # Bars may be wider than the distance between two values, so that they are seen.
      position = "identity", alpha = 0.4
    ) +
    ggplot2::geom_rug(sides = "b", length = ggplot2::unit(0.08, "npc")) +
    ggplot2::geom_vline(
      ggplot2::aes(xintercept = .data$median), data$rows, linetype = "dashed", linewidth = 0.8,
      colour = gym_colours[["ink"]]
    ) +
    ggplot2::facet_wrap(
      ggplot2::vars(.data$label), ncol = 1L, strip.position = "left",
      labeller = ggplot2::as_labeller(row_titles(data$rows), ggplot2::label_wrap_gen(30))
    ) +
    ggplot2::scale_fill_manual(
      values = named_colours(data$rows$label), aesthetics = c("fill", "colour"), guide = "none"
    ) +
    ggplot2::scale_x_continuous(
      breaks = (if (all(returns$few)) bar_marks(returns$value)) %||% ggplot2::waiver()
    ) +
    ggplot2::scale_y_continuous(breaks = NULL, expand = ggplot2::expansion(c(0.12, 0.03))) +
    picture_labels(data$title, data$subtitle, x = "return of an episode", y = NULL) +
    theme_gym() +
    ggplot2::theme(
      strip.text.y.left = ggplot2::element_text(angle = 0, hjust = 1),
      panel.spacing.y = ggplot2::unit(2, "pt")
    )
}

of_highest <- function(count, row) count / stats::ave(count, droplevels(row), FUN = max)

row_titles <- function(rows) {
  stats::setNames(paste0(rows$label, ", median ", number_text_each(rows$median)), rows$label)
}

#' Compute the data of a plot of several policies
#' @param rollouts A list of rollouts with names.
#' @return A list: `rows`, a data frame with a row for each policy, from the top: `label`, `median`;
#'   `returns`, a data frame: `label`, `value`, and `few`, whether the policy's returns are bars;
#'   `title`, `subtitle`.
#' @noRd
comparison_plot_data <- function(rollouts) {
  groups <- unlist(unname(Map(candidate_returns, rollouts, names(rollouts), length(rollouts) > 1L)),
                   recursive = FALSE)
  shown <- shown_groups(groups)
  # In the order of the rows, which is that of the colours.
  label <- factor(names(shown), names(shown))
  counts <- unique(range(lengths(shown)))
  list(
    rows = data.frame(
      label = label, median = vapply(shown, stats::median, 0), row.names = NULL
    ),
    returns = data.frame(
      label = rep(label, lengths(shown)), value = unlist(shown, use.names = FALSE),
      few = rep(vapply(shown, has_few, NA), lengths(shown))
    ),
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
