# Draws several policies in one picture. Each policy has a row with the distribution of its returns,
# and each environment has a column.

# With more rows a reader could not tell them apart.
most_rows <- 10L

comparison_picture <- function(rollouts) {
  data <- comparison_plot_data(rollouts)
  returns <- data$returns
  one_env <- nlevels(returns$env_id) == 1L
  ggplot2::ggplot(returns, ggplot2::aes(.data$value, fill = .data$label, colour = .data$label)) +
    # Scale each density, so that all rows have the same height.
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

row_titles <- function(rows) {
  stats::setNames(paste0(rows$label, ", median ", number_text_each(rows$median)), rows$label)
}

# Bars of one environment.
bars_of_rows <- function(returns) {
  few <- returns[returns$kind == "bars", ]
  whole <- returns[returns$kind == "histogram", ]
  of_highest <- function(count, row) count / stats::ave(count, droplevels(row), FUN = max)
  height <- ggplot2::aes(y = ggplot2::after_stat(of_highest(.data$count, .data$PANEL)))
  list(
    ggplot2::geom_bar(
      height, few, width = bar_width(few$value, returns$value),
      # Bars that must be wide enough to see may be wider than the distance between two values.
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
  by_env <- lapply(split_in_order(groups, ids), function(groups) {
    highest <- order(-vapply(groups, mean, 0))[seq_len(most_rows)]
    if (length(groups) <= most_rows) groups else groups[highest]
  })
  shown <- unlist(unname(by_env), recursive = FALSE)
  # Colours go by the order of the rows.
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
      if (length(shown) < length(groups)) best_policies_text(length(shown), length(groups)),
      episodes_each(lengths(shown)), if (length(by_env) > 1L) "dashed: median"
    )
  )
}

best_policies_text <- function(shown, all) {
  paste("the", shown, "of", all, "policies with the highest mean returns")
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

# Evaluations --------------------------------------------------------------------------

#' Plot evaluations of policies
#'
#' Show the mean return of each policy as a dot with its confidence interval. If there are more than
#' ten policies, the picture shows the ten with the highest mean returns.
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
        if (!few) best_policies_text(most_rows, nrow(object)),
        paste("bar:", level_text(attr(object, "level") %||% 0.95), "interval"),
        episodes_each(rows$episodes)
      ),
      x = "mean return", y = NULL
    ) +
    theme_gym()
}

#' Plot a comparison of trainings
#'
#' Show a comparison of trainings. If they were compared by scores, `type` chooses the picture: the
#' mean, median and interquartile mean of each training with their intervals (`"scores"`, the
#' default), the performance profiles (`"profile"`), or the probabilities that one training scores
#' higher than another (`"improvement"`). If they were compared by steps to a target, the picture
#' shows the share of runs that have reached the target, over the steps of the training, with its
#' interval. Ticks mark the ends of runs that failed or were interrupted.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A comparison, as returned by [compare_trainings()].
#' @param type What to show of scores, a string.
#' @param main The title. `NULL`, the default, names the environments.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` for another `type`.
#' @rdname plot.gym_comparison
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' trained <- lapply(list(ARS = agent_ars(), random = agent_random()), train_agent, "CartPole-v1",
#'                   total_steps = 2000, target = Inf, seeds = 1:5, eval_episodes = 10)
#' compared <- do.call(compare_trainings, trained)
#' plot(compared)
#' plot(compared, type = "improvement")
autoplot.gym_comparison <- function(object, type = c("scores", "profile", "improvement"), ...) {
  check_dots_empty(...)
  type <- check_choice(type[1L], c("scores", "profile", "improvement"), arg = "type")
  picture <- if (object$by == "steps") {
    reached_picture(object)
  } else {
    switch(
      type, scores = scores_picture(object), improvement = improvement_picture(object),
      profile = shares_picture(
        object$profile, "score", ggplot2::geom_step(direction = "hv", linewidth = 0.8)
      ) +
        picture_labels(x = score_label(object), y = "share of runs that score more")
    )
  }
  bands <- object$by == "steps" || type == "profile"
  shape <- if (bands) "band" else "bar"
  notes <- if (length(object$notes)) paste0("note: ", object$notes)
  picture +
    picture_labels(
      if (length(object$envs)) toString(object$envs),
      paste0(shape, ": ", percent_text(object$level), " interval"), caption = notes
    ) +
    theme_gym()
}

score_label <- function(x) if (is.null(x$reference)) "mean return" else "normalised score"

# Breaks the names of rows so that they fit a third of four inches.
named_rows <- function() ggplot2::scale_y_discrete(labels = function(at) broken_texts(at, 18))

scores_picture <- function(x) {
  table <- x$table
  table$statistic <- factor(table$statistic, unique(table$statistic))
  table$training <- factor(table$training, rev(unique(table$training)))
  ggplot2::ggplot(table, ggplot2::aes(
    .data$value, .data$training, xmin = .data$lower, xmax = .data$upper, colour = .data$training
  )) +
    ggplot2::geom_pointrange() +
    ggplot2::facet_wrap(
      ggplot2::vars(.data$statistic), ncol = 1L, labeller = ggplot2::as_labeller(
        c(mean = "mean", median = "median", iqm = "interquartile mean")
      )
    ) +
    ggplot2::scale_colour_manual(values = named_colours(unique(x$table$training)), guide = "none") +
    named_rows() +
    picture_labels(x = score_label(x), y = NULL)
}

# Draws lines with bands over scores or steps.
shares_picture <- function(rows, x, geom) {
  labels <- unique(rows$training)
  rows$training <- factor(rows$training, labels)
  ggplot2::ggplot(rows, ggplot2::aes(
    .data[[x]], .data$share, colour = .data$training, fill = .data$training
  )) +
    ggplot2::geom_ribbon(
      ggplot2::aes(ymin = .data$lower, ymax = .data$upper), rows[!is.na(rows$lower), ],
      alpha = 0.25, linetype = "blank", show.legend = FALSE
    ) +
    geom +
    ggplot2::scale_fill_manual(values = named_colours(labels), guide = "none") +
    key_of_marks(line_marks(labels)) +
    ggplot2::coord_cartesian(ylim = c(0, 1))
}

improvement_picture <- function(x) {
  rows <- x$improvement
  if (is.null(rows)) {
    abort_wrong("type", "improvement", NULL,
                "There is only one training, so there is nothing to compare.")
  }
  rows$pair <- paste0(rows$training, " > ", rows$than)
  ggplot2::ggplot(rows, ggplot2::aes(
    .data$probability, factor(.data$pair, rev(.data$pair)), xmin = .data$lower, xmax = .data$upper
  )) +
    ggplot2::geom_vline(xintercept = 0.5, linetype = "dashed", colour = gym_colours[["ink"]]) +
    ggplot2::geom_pointrange(colour = gym_colours[["blue"]]) +
    ggplot2::coord_cartesian(xlim = c(0, 1)) +
    named_rows() +
    picture_labels(x = "probability of a higher score", y = NULL)
}

reached_picture <- function(x) {
  # geom_ribbon() draws no steps, so add the corners of the steps.
  rows <- do.call(rbind, lapply(split(x$profile, list(x$profile$training, x$profile$env_id),
                                      drop = TRUE), function(rows) {
    n <- nrow(rows)
    corners <- rows[rep(seq_len(n), each = 2L)[-2L * n], ]
    corners$steps <- rows$steps[rep(seq_len(n), each = 2L)[-1L]]
    corners
  }))
  failed <- x$runs[!x$runs$reached, ]
  key <- function(rows) paste(rows$training, rows$env_id, rows$steps, sep = "\r")
  failed$share <- x$profile$share[match(key(failed), key(x$profile))]
  labels <- unique(x$runs$training)
  failed$training <- factor(failed$training, labels)
  rows <- rows[order(match(rows$training, labels)), ]
  shares_picture(rows, "steps", ggplot2::geom_path(linewidth = 0.8)) +
    ggplot2::geom_point(data = failed, shape = 3, show.legend = FALSE) +
    (if (length(unique(rows$env_id)) > 1L) {
      ggplot2::facet_wrap(
        ggplot2::vars(.data$env_id), scales = "free_x", labeller = ggplot2::as_labeller(x$envs)
      )
    }) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA)) +
    picture_labels(x = training_steps_label, y = "share that reached the target")
}

#' Plot estimates from data
#'
#' Show the estimate of each method with its interval. The dashed line is the mean return in the
#' data, and the band is its interval.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [evaluate_offline()].
#' @param main The title. `NULL`, the default, says what is estimated.
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_offline
#' @exportS3Method ggplot2::autoplot
#' @examples
#' set.seed(1)
#' steps <- data.frame(episode = 1:200, severity = runif(200), action = rep(0:1, 100))
#' steps$reward <- ifelse(steps$action == 1, steps$severity, 0.4) + rnorm(200, sd = 0.3)
#' plot(evaluate_offline(steps_data(steps), 1, behavior = policy_random(), seed = 1))
autoplot.gym_offline <- function(object, ...) {
  check_dots_empty(...)
  each <- object$estimates
  each$method <- factor(each$method, rev(each$method))
  known <- !is.na(object$observed$estimate)
  marks <- list(
    estimate = key_mark("blue", shape = 16),
    `the data's policy` = if (known) key_mark("ink", line = "dashed")
  )
  ggplot2::ggplot(each, ggplot2::aes(x = .data$estimate, y = .data$method)) +
    (if (known) {
      list(
        ggplot2::annotate(
          "rect", xmin = object$observed$lower, xmax = object$observed$upper, ymin = -Inf,
          ymax = Inf, fill = "grey90"
        ),
        ggplot2::geom_vline(
          ggplot2::aes(xintercept = .data$estimate, colour = "the data's policy"), object$observed,
          linetype = "dashed", linewidth = 0.7
        )
      )
    }) +
    ggplot2::geom_segment(
      ggplot2::aes(x = .data$lower, xend = .data$upper, yend = .data$method, colour = "estimate"),
      linewidth = 0.7
    ) +
    ggplot2::geom_point(ggplot2::aes(colour = "estimate"), size = 2.5) +
    key_of_marks(marks) +
    picture_labels(
      if (is.null(object$folds)) "Value of the policy, by data" else "Mean value of the rules",
      paste0(level_text(object$level), " intervals, ", count_of(object$episodes, "episode"),
             if (!is.null(object$folds)) paste0(", ", object$folds, " folds")),
      x = if (object$discount < 1) "discounted return" else "return", y = NULL
    ) +
    theme_gym()
}
