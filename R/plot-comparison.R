# Several policies in one picture: a row for each with the distribution of its returns, and a column
# for each environment.

# More rows than this could not be told apart.
most_rows <- 10L

comparison_picture <- function(rollouts) {
  data <- comparison_plot_data(rollouts)
  returns <- data$returns
  one_env <- nlevels(returns$env_id) == 1L
  ggplot2::ggplot(
    returns, ggplot2::aes(.data$value, fill = .data$label, colour = .data$label)
  ) +
    # All rows have the same height.
    ggplot2::geom_density(
      ggplot2::aes(y = ggplot2::after_stat(.data$scaled)), returns[returns$kind == "density", ],
      trim = TRUE, alpha = 0.4
    ) +
    lapply(unname(split(returns, returns$env_id)), bars_of_rows) +
    ggplot2::geom_rug(sides = "b", length = ggplot2::unit(0.08, "npc")) +
    ggplot2::geom_vline(
      ggplot2::aes(xintercept = .data$median), data$rows, linetype = "dashed", linewidth = 0.8,
      colour = gym_colours[["ink"]]
    ) +
    (if (one_env) {
      ggplot2::facet_wrap(
        ggplot2::vars(.data$label), ncol = 1L, strip.position = "left",
        labeller = ggplot2::as_labeller(function(labels) {
          broken_texts(row_titles(data$rows)[labels], 24)
        })
      )
    } else {
      ggplot2::facet_grid(
        ggplot2::vars(.data$label), ggplot2::vars(.data$env_id), scales = "free_x", switch = "y",
        labeller = ggplot2::labeller(
          label = wrapped_strips(3), env_id = ggplot2::as_labeller(data$envs, wrapped_strips(3))
        )
      )
    }) +
    ggplot2::scale_fill_manual(
      values = named_colours(levels(data$rows$label)), aesthetics = c("fill", "colour"),
      guide = "none"
    ) +
    ggplot2::scale_x_continuous(
      breaks = (if (one_env && all(returns$kind == "bars")) bar_marks(returns$value)) %||%
        ggplot2::waiver()
    ) +
    ggplot2::scale_y_continuous(breaks = NULL, expand = ggplot2::expansion(c(0.12, 0.03))) +
    picture_labels(toString(data$envs), data$subtitle, x = "return of an episode", y = NULL) +
    theme_gym() +
    ggplot2::theme(
      strip.text.y.left = ggplot2::element_text(angle = 0, hjust = 1),
      panel.spacing.y = ggplot2::unit(2, "pt")
    )
}

# Bars of one environment.
bars_of_rows <- function(returns) {
  few <- returns[returns$kind == "bars", ]
  whole <- returns[returns$kind == "histogram", ]
  height <- ggplot2::aes(y = ggplot2::after_stat(of_highest(.data$count, .data$PANEL)))
  list(
    ggplot2::geom_bar(
      height, few, width = bar_width(few$value, returns$value),
      # Bars may be wider than the distance between two values, so that they are seen.
      position = "identity", alpha = 0.4
    ),
    if (nrow(whole)) {
      ggplot2::geom_histogram(
        height, whole, binwidth = bin_width(whole$value), boundary = max(whole$value) + 0.5,
        position = "identity", alpha = 0.4
      )
    }
  )
}
of_highest <- function(count, row) count / stats::ave(count, droplevels(row), FUN = max)

row_titles <- function(rows) {
  stats::setNames(paste0(rows$label, ", median ", number_text_each(rows$median)), rows$label)
}

#' Compute the data of a plot of several policies
#' @param rollouts A list of rollouts with names.
#' @return A list: `rows`, a data frame with a row for each policy and environment, from the top:
#'   `label`, `env_id`, `median`; `returns`, a data frame: `label`, `env_id`, `value`, and `kind`,
#'   how the policy's returns are drawn; `envs`, as [env_names()] returns them; `subtitle`.
#' @noRd
comparison_plot_data <- function(rollouts) {
  each <- Map(candidate_returns, rollouts, names(rollouts), length(rollouts) > 1L)
  ids <- rep(vapply(rollouts, function(x) x$env_id, ""), lengths(each))
  groups <- unlist(unname(each), recursive = FALSE)
  by_env <- lapply(split(groups, factor(ids, unique(ids))), shown_groups)
  shown <- unlist(unname(by_env), recursive = FALSE)
  # In the order of the rows, which is that of the colours.
  label <- factor(names(shown), unique(names(shown)))
  env_id <- factor(rep(names(by_env), lengths(by_env)), names(by_env))
  list(
    rows = data.frame(
      label = label, env_id = env_id, median = vapply(shown, stats::median, 0), row.names = NULL
    ),
    returns = data.frame(
      label = rep(label, lengths(shown)), env_id = rep(env_id, lengths(shown)),
      value = unlist(shown, use.names = FALSE),
      kind = rep(vapply(shown, returns_kind, ""), lengths(shown))
    ),
    envs = env_names(rollouts),
    subtitle = c(
      if (length(shown) < length(groups)) {
        paste("the", length(shown), "of", length(groups), "policies with the highest mean returns")
      },
      episodes_each(lengths(shown)), if (length(by_env) > 1L) "dashed: median"
    )
  )
}

episodes_each <- function(counts) {
  counts <- vapply(unique(range(counts)), whole_number_text, "")
  paste(paste(counts, collapse = " to "), "episodes each")
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

# Evaluations --------------------------------------------------------------------------

#' Plot evaluations of policies
#'
#' Show the mean return of each policy as a dot with its confidence interval. Of more than ten
#' policies, the ten with the highest mean returns are shown.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [evaluate_policy()].
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if columns of the evaluation were removed.
#' @rdname plot.gym_evaluation
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' follow_pole <- function(observation) as.integer(observation[, 3] > 0)
#' policies <- list(random = policy_random(), follow = follow_pole)
#' plot(evaluate_policy("CartPole-v1", policies, episodes = 50, seed = 1))
autoplot.gym_evaluation <- function(object, ...) {
  check_dots_empty(...)
  missing <- setdiff(evaluation_columns, names(object))
  if (length(missing)) {
    must <- paste0("an evaluation with its column `", missing[[1L]], "`")
    abort_argument(object, must, "object", rlang::current_env())
  }
  few <- nrow(object) <= most_rows
  shown <- if (few) seq_len(nrow(object)) else order(-object$mean_return)[seq_len(most_rows)]
  rows <- as.data.frame(as.list(object)[evaluation_columns])[shown, ]
  rows$label <- factor(row.names(object)[shown], rev(row.names(object)[shown]))
  ggplot2::ggplot(rows, ggplot2::aes(.data$mean_return, .data$label)) +
    # A single episode has no interval.
    ggplot2::geom_linerange(
      ggplot2::aes(xmin = .data$lower, xmax = .data$upper), colour = gym_colours[["blue"]],
      linewidth = 0.8, na.rm = TRUE
    ) +
    ggplot2::geom_point(colour = gym_colours[["blue"]], size = 2.5) +
    number_axis(ggplot2::scale_x_continuous) +
    picture_labels(
      env_text(attributes(object)),
      c(
        if (!few) {
          paste("the", most_rows, "of", nrow(object), "policies with the highest mean returns")
        },
        paste("bar:", level_text(attr(object, "level") %||% 0.95), "interval"),
        episodes_each(rows$episodes)
      ),
      x = "mean return", y = NULL
    ) +
    theme_gym()
}
