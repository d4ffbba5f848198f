# The distribution of the returns of a rollout's episodes.

returns_picture <- function(x) {
  data <- returns_plot_data(x$episodes$return)
  few <- !is.null(data$bars)
  ggplot2::ggplot(data.frame(value = data$returns), ggplot2::aes(.data$value)) +
    (if (few) bar_layers(data$bars) else density_layers(data$density)) +
    ggplot2::geom_vline(
      xintercept = data$median, colour = gym_colours[["brown"]], linetype = "dashed",
      linewidth = 0.8
    ) +
    ggplot2::scale_y_continuous(
      breaks = if (few) few_breaks else ggplot2::waiver(),
      expand = ggplot2::expansion(mult = c(0, 0.05))
    ) +
    picture_labels(
      x$env_id,
      c(policy_subtitle(x), count_of(length(data$returns), "episode"),
        paste("median", number_text(data$median), "(dashed)")),
      x = returns_label, y = if (few) "episodes" else "density"
    ) +
    theme_gym()
}

density_layers <- function(density) {
  list(
    ggplot2::geom_area(
      ggplot2::aes(.data$x, .data$y), density, stat = "identity", fill = gym_colours[["sky"]],
      alpha = 0.6, colour = gym_colours[["blue"]]
    ),
    ggplot2::geom_rug(sides = "b", colour = gym_colours[["blue"]])
  )
}

bar_layers <- function(bars) {
  list(
    ggplot2::geom_rect(
      ggplot2::aes(xmin = .data$xmin, xmax = .data$xmax, ymin = 0, ymax = .data$episodes), bars,
      inherit.aes = FALSE, fill = gym_colours[["sky"]], alpha = 0.6, colour = gym_colours[["blue"]]
    ),
    ggplot2::scale_x_continuous(
      breaks = bar_marks(bars) %||% ggplot2::waiver(),
      # A single bar must not fill the picture.
      expand = ggplot2::expansion(mult = if (nrow(bars) == 1L) 2 else 0.05)
    )
  )
}

# With few different returns a density would show values that no episode had, so use bars.
most_bars <- 10L

#' Compute the data of a plot of returns
#' @return A list: `returns`, `median`, `bars` (data frame `value`, `episodes`, `xmin`, `xmax`,
#'   `NULL` if there are many different returns), `density` (data frame `x`, `y`, `NULL` if there
#'   are bars).
#' @noRd
returns_plot_data <- function(returns) {
  values <- sort(unique(returns))
  few <- length(values) <= min(most_bars, max(3, length(returns) / 2))
  list(
    returns = returns,
    median = stats::median(returns),
    bars = if (few) {
      half <- bar_half(values)
      data.frame(
        value = values, episodes = tabulate(match(returns, values)), xmin = values - half,
        xmax = values + half
      )
    },
    density = if (!few) {
      estimate <- stats::density(returns, from = min(returns), to = max(returns))
      data.frame(x = estimate$x, y = estimate$y)
    }
  )
}

# Bars are as wide as the two nearest values allow, but wide enough to be seen `across` the axis. A
# single bar is a fifth of a unit wide, or of a tenth of its value.
bar_half <- function(values, across = diff(range(values))) {
  if (length(values) == 1L) {
    0.2 * max(1, abs(values) / 10)
  } else {
    max(0.4 * min(diff(sort(values))), across / 200)
  }
}

# Axis marks at the values of bars; NULL if two are too near for their numbers to fit.
bar_marks <- function(bars) {
  if (nrow(bars) == 1L || min(diff(sort(bars$value))) > diff(range(bars$value)) / 12) bars$value
}
