#' Plot a rollout with ggplot2
#'
#' The same pictures as [plot()][plot.gym_rollout()], from the same data, as objects of ggplot2,
#' to be changed and saved in its ways. A trajectory has a facet for each part of the observation
#' and one for the actions.
#'
#' @param object What [rollout()] returned. It may have another name, that of its row, as for
#'   [plot()][plot.gym_rollout()].
#' @param type `"returns"`, the default, or `"trajectory"`.
#' @param episode,variables,candidate As for [plot()][plot.gym_rollout()].
#' @param ... Further rollouts to compare, with the names of their rows or without.
#' @return An object of class `ggplot`.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, and for a
#'   rollout that was played without steps where a trajectory is wanted.
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server() && requireNamespace("ggplot2", quietly = TRUE)
#' library(ggplot2)
#' played <- rollout("CartPole-v1", policy_random(), episodes = 50, seed = 1, steps = TRUE)
#' autoplot(played) + theme_minimal()
#' autoplot(played, type = "trajectory", episode = 2)
autoplot.gym_rollout <- function(object, ..., type = c("returns", "trajectory"), episode = 1,
                                 variables = NULL, candidate = 1) {
  type <- check_choice(type[1L], c("returns", "trajectory"), arg = "type")
  given <- if (missing(object)) {
    given_rollouts(list(...), substitute(list(...)))
  } else {
    given_rollouts(list(object, ...), substitute(list(object, ...)))
  }
  rlang::exec(check_dots_empty, !!!given$others)
  rollouts <- given$rollouts
  object <- rollouts[[1L]]
  if (type == "returns") {
    if (is_comparison(rollouts)) autoplot_comparison(rollouts) else autoplot_returns(object)
  } else {
    check_single_rollout(rollouts, type)
    autoplot_trajectory(object, trajectory_plot_data(object, episode, variables, candidate))
  }
}

autoplot_returns <- function(x) {
  data <- returns_plot_data(x$episodes$return)
  ggplot2::ggplot(data.frame(value = data$returns), ggplot2::aes(x = .data$value)) +
    (if (is.null(data$bars)) density_layers(data$density) else bar_layers(data$bars)) +
    ggplot2::geom_vline(xintercept = data$median, colour = okabe_ito$vermillion,
                        linetype = "dashed") +
    ggplot2::coord_cartesian(xlim = data$xlim, ylim = data$ylim) +
    ggplot2::labs(
      x = returns_label, y = returns_measure(data), title = played_title(x),
      subtitle = median_label(data)
    )
}

density_layers <- function(density) {
  list(
    ggplot2::geom_area(
      ggplot2::aes(x = .data$x, y = .data$y), data = density, stat = "identity",
      fill = okabe_ito$sky_blue, alpha = 0.4, colour = okabe_ito$blue
    ),
    ggplot2::geom_rug(sides = "b", colour = okabe_ito$blue)
  )
}

bar_layers <- function(bars) {
  at <- bar_marks(bars) %||% ggplot2::waiver()
  list(
    ggplot2::geom_rect(
      ggplot2::aes(xmin = .data$xmin, xmax = .data$xmax, ymin = 0, ymax = .data$episodes),
      data = bars, inherit.aes = FALSE, fill = okabe_ito$sky_blue, alpha = 0.4,
      colour = okabe_ito$blue
    ),
    ggplot2::scale_x_continuous(breaks = at),
    ggplot2::scale_y_continuous(breaks = few_breaks)
  )
}

autoplot_trajectory <- function(x, data) {
  panel <- function(rows) factor(rows$panel, levels = data$panels$panel)
  values <- autoplot_values(data)
  near <- near_rows(data)
  near$panel <- panel(near)
  ggplot2::ggplot() +
    lapply(names(limit_colours), function(kind) {
      ggplot2::geom_hline(
        ggplot2::aes(yintercept = .data$at), data = near[near$kind == kind, ],
        linetype = "dashed", colour = limit_colours[[kind]]
      )
    }) +
    ggplot2::geom_vline(xintercept = data$length, colour = ending_colours[[data$ending]]) +
    trajectory_layers(values, data) +
    ggplot2::facet_wrap(ggplot2::vars(.data$panel), scales = "free_y", ncol = 2L,
                        labeller = ggplot2::as_labeller(facet_labels(data))) +
    ggplot2::scale_y_continuous(breaks = trajectory_breaks(values)) +
    ggplot2::labs(x = "steps taken", y = NULL, title = played_title(x),
                  subtitle = data$subtitle)
}

# The values with the kind of their panel and, where an action has several numbers, with the number
# of it that they are.
autoplot_values <- function(data) {
  values <- data$values
  values$kind <- data$panels$kind[match(values$panel, data$panels$panel)]
  parts <- if (length(data$actions) > 1L) data$actions else character()
  values$part <- factor(unname(parts[values$name]), levels = unname(parts))
  values$panel <- factor(values$panel, levels = data$panels$panel)
  values
}

trajectory_layers <- function(values, data) {
  of_kind <- function(kind, several = FALSE) {
    values[values$kind == kind & is.na(values$part) != several, ]
  }
  place <- ggplot2::aes(x = .data$time, y = .data$value)
  part <- ggplot2::aes(x = .data$time, y = .data$value, colour = .data$part)
  layers <- list(
    ggplot2::geom_line(place, data = of_kind("line"), colour = okabe_ito$blue),
    ggplot2::geom_step(place, data = of_kind("stairs"), colour = okabe_ito$blue),
    ggplot2::geom_tile(
      ggplot2::aes(x = .data$time + 0.5, y = .data$value), data = of_kind("choice"),
      width = 1, height = 0.7, fill = okabe_ito$blue
    )
  )
  if (!is.null(data$choices)) {
    # Those that were never chosen have their place, too.
    panel <- values$panel[values$kind == "choice"][[1L]]
    ends <- data.frame(value = range(data$choices$value) + c(-0.5, 0.5), panel = panel)
    layers <- c(layers, ggplot2::geom_blank(ggplot2::aes(y = .data$value), data = ends))
  }
  if (length(data$actions) > 1L) {
    layers <- c(layers, list(
      ggplot2::geom_line(part, data = of_kind("line", several = TRUE)),
      ggplot2::geom_step(part, data = of_kind("stairs", several = TRUE)),
      ggplot2::scale_colour_manual(values = line_colours, name = NULL),
      ggplot2::theme(legend.position = "bottom")
    ))
  }
  layers
}

# The marks of an axis: all whole numbers where there are only a few, because actions are whole.
few_breaks <- function(limits) {
  from <- ceiling(limits[[1L]])
  to <- floor(limits[[2L]])
  if (from < to && to - from < 7) from:to else pretty(limits)
}

# The axis of a panel in which a value is constant has a mark at this value alone. ggplot2 passes
# only the limits of a panel: around a constant that is 0.05 to either side.
trajectory_breaks <- function(values) {
  shown <- values[values$kind != "choice" & is.finite(values$value), ]
  each <- split(shown$value, shown$panel)
  constants <- unlist(lapply(each, function(value) if (length(unique(value)) == 1L) value[[1L]]))
  function(limits) {
    middle <- mean(limits)
    own <- constants[abs(constants - middle) <= 1e-9 * max(1, abs(middle))]
    if (length(own) && diff(limits) < 0.11) own[[1L]] else few_breaks(limits)
  }
}

near_rows <- function(data) {
  keep <- vapply(seq_len(nrow(data$limits)), function(i) {
    limit <- data$limits[i, ]
    length(near_limits(limit$at, data$values$value[data$values$panel == limit$panel])) > 0L
  }, NA)
  data$limits[keep, ]
}

# Facets have no axis labels of their own: their titles explain what the numbers mean.
facet_labels <- function(data) {
  labels <- data$panels$panel
  text <- vapply(labels, function(label) {
    unique(data$limits$text[data$limits$panel == label])[1L]
  }, "")
  words <- ifelse(is.na(text), labels, paste0(labels, ", ", text))
  choice <- data$panels$kind == "choice"
  words[choice] <- paste0(
    labels[choice], ": ", paste(data$choices$value, data$choices$label, collapse = ", ")
  )
  stats::setNames(words, labels)
}
