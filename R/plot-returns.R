# The distribution of the returns of a rollout's episodes.

returns_picture <- function(x) {
  returns <- x$episodes$return
  kind <- returns_kind(returns)
  counts <- kind != "density"
  ggplot2::ggplot(data.frame(value = returns), ggplot2::aes(.data$value)) +
    switch(
      kind, bars = bar_layers(returns), histogram = histogram_layers(returns),
      density = density_layers()
    ) +
    ggplot2::geom_vline(
      xintercept = stats::median(returns), colour = gym_colours[["brown"]], linetype = "dashed",
      linewidth = 0.8
    ) +
    ggplot2::scale_y_continuous(
      breaks = if (counts) few_breaks else ggplot2::waiver(),
      expand = ggplot2::expansion(mult = c(0, 0.05))
    ) +
    picture_labels(
      env_text(x),
      c(policy_subtitle(x), count_of(length(returns), "episode"),
        paste("median", number_text(stats::median(returns)), "(dashed)")),
      x = returns_label, y = if (counts) "episodes" else "density"
    ) +
    theme_gym()
}

density_layers <- function() {
  list(
    ggplot2::geom_density(
      fill = gym_colours[["sky"]], alpha = 0.6, colour = gym_colours[["blue"]]
    ),
    ggplot2::geom_rug(sides = "b", colour = gym_colours[["blue"]])
  )
}

histogram_layers <- function(returns) {
  list(
    ggplot2::geom_histogram(
      binwidth = bin_width(returns), boundary = max(returns) + 0.5, fill = gym_colours[["sky"]],
      alpha = 0.6, colour = gym_colours[["blue"]]
    ),
    ggplot2::scale_x_continuous(breaks = few_breaks)
  )
}

# Bins are whole numbers wide, and end at the largest return, which may be the largest possible one.
bin_width <- function(returns) max(1, ceiling((diff(range(returns)) + 1) / most_bins))

most_bins <- 40L

bar_layers <- function(returns) {
  list(
    ggplot2::geom_bar(
      width = bar_width(returns), position = "identity", fill = gym_colours[["sky"]], alpha = 0.6,
      colour = gym_colours[["blue"]]
    ),
    ggplot2::scale_x_continuous(
      breaks = bar_marks(returns) %||% ggplot2::waiver(),
      # A single bar must not fill the picture.
      expand = ggplot2::expansion(mult = if (length(unique(returns)) == 1L) 2 else 0.05)
    )
  )
}

# With few different returns a density would show values that no episode had, so use bars.
most_bars <- 10L

has_few <- function(returns) {
  length(unique(returns)) <= min(most_bars, max(3, length(returns) / 2))
}

# How returns are drawn: few different ones as bars, other whole numbers as a histogram.
returns_kind <- function(returns) {
  if (has_few(returns)) "bars" else if (all_whole(returns)) "histogram" else "density"
}

# Bars are as wide as the two nearest values allow, and those of whole numbers at most 1, but wide
# enough to be seen among `all` values.
bar_width <- function(values, all = values) {
  values <- sort(unique(values))
  if (!length(values)) {
    return(NULL)
  }
  widest <- if (all_whole(values)) 0.9 else Inf
  apart <- if (length(values) == 1L) min(1, abs(values)) / 10 else 0.8 * min(diff(values))
  if (length(values) == 1L && all_whole(values)) apart <- widest
  max(min(apart, widest), diff(range(all)) / 100)
}

# Axis marks at the values of bars; NULL if two are too near for their numbers to fit.
bar_marks <- function(values) {
  values <- sort(unique(values))
  if (length(values) == 1L || all(diff(values) > diff(range(values)) / 12)) values
}
