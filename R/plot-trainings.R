# Draws several trainings in one picture: of many seeds, or of several agents.

#' Plot trainings
#'
#' Show the mean returns of the agents' policies over the steps of the environment. For trainings
#' with several seeds ([gym_trainings]), the line is the median of the seeds and the band their
#' middle half. For a single training, the line connects its evaluations. The dashed line is the
#' target. Several trainings are compared in one picture, which has a panel for each environment.
#'
#' `type = "iterations"` shows bars of how many iterations the seeds needed to reach the target. The
#' text says how many seeds reached it.
#'
#' Between two evaluations the return is interpolated linearly. The line of several seeds is thick
#' while all of them train. It becomes thin when the first seed ends; after its end, a seed counts
#' with its last evaluation. The line of a single training is thin after its end, too. The picture
#' begins when all seeds have an evaluation. If targets, budgets or rules of evaluation differ in
#' one environment, the caption names them.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object Trainings, as returned by `train_agent(seeds = )`. You may give the argument
#'   another name, which then names their line, as in `plot(ARS = first, CEM = second)`.
#' @param type What to show, a string: `"returns"` or `"iterations"`. The default is `"returns"`.
#'   For searches by [search_random()] it is `"iterations"`, because a search has no evaluations.
#' @param ... Further trainings to compare, of class `gym_trainings` or `gym_training`, optionally
#'   with names for their lines.
#' @param main The title. `NULL`, the default, names the environment, the agent and the number of
#'   seeds.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if a training was never evaluated, or for `"iterations"` if
#'   no seed has reached the target.
#' @rdname plot.gym_trainings
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' ars <- train_agent(agent_ars(), "CartPole-v1", iterations = 10, eval_every = 2, seeds = 1:4)
#' plot(ars)
#' hill <- train_agent(agent_hill_climb(candidates = 16), "CartPole-v1", iterations = 10,
#'                     eval_every = 2, seeds = 1:4)
#' plot(ARS = ars, `hill climbing` = hill)
autoplot.gym_trainings <- function(object, ..., type = c("returns", "iterations")) {
  trainings <- given_trainings(arguments_as_written(quote(object)))
  if (missing(type) && are_searches(trainings)) type <- "iterations"
  type <- check_choice(type[1L], c("returns", "iterations"), arg = "type")
  if (type == "returns") trainings_picture(trainings) else iterations_picture(trainings)
}

are_searches <- function(trainings) {
  all(vapply(unlist(lapply(trainings, each_training), FALSE), inherits, NA, "gym_search"))
}

# A panel for each training.
iterations_picture <- function(trainings, call = rlang::caller_env()) {
  each <- lapply(trainings, function(x) Filter(function(one) !one$interrupted, each_training(x)))
  needed <- lapply(each, function(seeds) {
    reached <- Filter(function(one) isTRUE(one$solved), seeds)
    vapply(reached, function(one) nrow(one$history), 0L)
  })
  if (!length(unlist(needed))) {
    abort_wrong("x", trainings[[1L]], call,
                "There is nothing to plot: no seed has reached the target.")
  }
  counts <- paste(lengths(needed), "of", lengths(each))
  several <- length(each) > 1L
  panels <- if (several) paste0(names(each), ": ", counts) else counts
  bars <- data.frame(
    iterations = unlist(needed, use.names = FALSE),
    panel = factor(rep(panels, lengths(needed)), panels)
  )
  ggplot2::ggplot(bars, ggplot2::aes(.data$iterations)) +
    ggplot2::geom_histogram(
      binwidth = bin_width(bars$iterations), boundary = 0.5, fill = gym_colours[["blue"]],
      colour = "white", linewidth = 0.2
    ) +
    (if (several) ggplot2::facet_wrap(ggplot2::vars(.data$panel), ncol = 1L, drop = FALSE)) +
    number_axis(ggplot2::scale_x_continuous) +
    ggplot2::scale_y_continuous(breaks = few_breaks) +
    picture_labels(
      trainings_title(trainings), if (!several) paste(counts, "seeds have reached the target"),
      x = paste(if (are_searches(trainings)) "rounds" else "iterations", "to the target"),
      y = "seeds"
    ) +
    theme_gym()
}

trainings_picture <- function(trainings, call = rlang::caller_env()) {
  each <- Map(evaluation_curves, trainings, names(trainings), list(call))
  labels <- unique(names(trainings))
  shown <- env_names(trainings)
  ids <- factor(vapply(trainings, function(x) x$env_id, ""), names(shown))
  ends <- vapply(each, function(curves) max(unlist(lapply(curves, `[[`, "steps"))), 0)
  last <- stats::ave(ends, ids, FUN = max)
  curves <- do.call(rbind, Map(trainings_curve, each, names(trainings), last, seq_along(ids)))
  curves$env_id <- ids[curves$training]
  curves$label <- factor(curves$label, labels)
  # One for each environment.
  target <- unlist(lapply(split(trainings, ids), common_target))
  seeds <- any(vapply(trainings, inherits, NA, "gym_trainings"))
  ended <- if (seeds) {
    "thin line: a seed has ended, and counts with its last evaluation"
  } else {
    "thin line: the training has ended, with this evaluation"
  }
  ggplot2::ggplot(curves, ggplot2::aes(.data$steps, colour = .data$label)) +
    ggplot2::geom_ribbon(
      ggplot2::aes(ymin = .data$lower, ymax = .data$upper, fill = .data$label), alpha = 0.25,
      linetype = "blank", show.legend = FALSE
    ) +
    target_line(target, env_id = factor(names(target), levels(ids))) +
    ggplot2::geom_line(
      ggplot2::aes(y = .data$median), lines_of(curves, !curves$ended), linewidth = 0.8
    ) +
    ggplot2::geom_line(
      ggplot2::aes(y = .data$median), lines_of(curves, curves$steps >= curves$first_end),
      linewidth = 0.4, show.legend = FALSE
    ) +
    # A line of one point is invisible.
    ggplot2::geom_pointrange(
      ggplot2::aes(y = .data$median, ymin = .data$lower, ymax = .data$upper),
      curves[points_each(curves) == 1, ], show.legend = FALSE
    ) +
    (if (nlevels(ids) > 1L) {
      ggplot2::facet_wrap(
        ggplot2::vars(.data$env_id), scales = "free", labeller = ggplot2::as_labeller(shown)
      )
    }) +
    ggplot2::scale_fill_manual(values = named_colours(labels), guide = "none") +
    key_of_marks(c(line_marks(labels), target_mark(target))) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA)) +
    picture_labels(
      trainings_title(trainings), if (seeds) "line: median of the seeds, band: their middle half",
      x = training_steps_label, y = "mean return of the policy",
      caption = c(if (any(curves$ended)) ended, unequal_rules(trainings))
    ) +
    theme_gym()
}

# The rows of trainings with more than one point.
lines_of <- function(curves, rows) {
  curves <- curves[rows, ]
  curves[points_each(curves) > 1, ]
}

points_each <- function(curves) stats::ave(curves$steps, curves$training, FUN = length)

# The common target, or NULL.
common_target <- function(trainings) {
  targets <- unique(lapply(unname(trainings), function(x) as.numeric(x$target)))
  if (length(targets) == 1L && length(targets[[1L]])) finite_target(targets[[1L]])
}

evaluation_curves <- function(x, label, call) {
  each <- lapply(each_training(x), function(training) {
    data.frame(steps = evaluation_steps(training), mean_return = training$evaluations$mean_return)
  })
  each <- each[vapply(each, nrow, 0L) > 0L]
  if (!length(each)) {
    abort_wrong("x", x, call, "There is nothing to plot: no policy of {label} was evaluated.")
  }
  each
}

#' Compute the line and the band of one training or several seeds
#' @param each The result of [evaluation_curves()].
#' @param last The number of steps at which the panel ends.
#' @param training The number of the training.
#' @return A data frame with a row for each place: `label`, `training`, `steps`, `median`, `lower`,
#'   `upper` of the seeds, `ended`, whether a seed had ended before, and `first_end`, the place
#'   where the first seed ended.
#' @noRd
trainings_curve <- function(each, label, last, training) {
  from <- max(vapply(each, function(curve) min(curve$steps), 0))
  ends <- vapply(each, function(curve) max(curve$steps), 0)
  first_end <- max(from, min(ends))
  steps <- if (length(each) == 1L) {
    each[[1L]]$steps
  } else {
    seq(min(from, max(ends)), max(ends), length.out = 200L)
  }
  steps <- sort(unique(c(steps, first_end, if (length(steps) > 1L) last)))
  values <- vapply(each, returns_at, numeric(length(steps)), steps)
  values <- matrix(values, nrow = length(steps))
  quantile <- function(p) apply(values, 1L, stats::quantile, probs = p, names = FALSE)
  data.frame(
    label = label, training = training, steps = steps, median = quantile(0.5),
    lower = quantile(0.25), upper = quantile(0.75), ended = steps > first_end,
    first_end = first_end, row.names = NULL
  )
}

trainings_title <- function(trainings) {
  where <- toString(env_names(trainings))
  if (length(trainings) > 1L) {
    return(where)
  }
  x <- trainings[[1L]]
  count <- if (inherits(x, "gym_trainings")) paste0(", ", count_of(length(x$trainings), "seed"))
  paste0(training_label(x), " in ", where, count)
}

# Sweeps -------------------------------------------------------------------------------

#' @param object A sweep.
#' @rdname sweep_agent
#' @exportS3Method ggplot2::autoplot
autoplot.gym_sweep <- function(object, ...) {
  check_dots_empty(...)
  trained <- Filter(Negate(is.null), object$trainings)
  target <- common_target(trained)
  picture <- trainings_picture(trained)
  # There is no key, which would name the target, because the panels have titles. So the subtitle
  # names it.
  dashed <- if (!is.null(target)) paste("dashed line:", target_label(target))
  titles <- varied_settings(names(trained))
  picture +
    ggplot2::labs(
      subtitle = paste(
        broken_texts(c(picture$labels$subtitle, titles$constant, dashed), 54), collapse = "\n"
      )
    ) +
    ggplot2::facet_wrap(
      ggplot2::vars(.data$label), ncol = 2L, labeller = ggplot2::as_labeller(function(labels) {
        broken_texts(titles$each[labels], 33)
      })
    ) +
    theme_gym_panels() +
    ggplot2::theme(legend.position = "none")
}

# Splits the names of settings, such as "step_size = 0.1, noise = 0.05", into the part that they
# share and the part that varies. The panels' titles show only the second.
varied_settings <- function(names) {
  parts <- strsplit(names, ", ", fixed = TRUE)
  shared <- if (length(names) > 1L) Reduce(intersect, parts)
  each <- vapply(parts, function(part) paste(setdiff(part, shared), collapse = ", "), "")
  list(
    constant = if (length(shared)) paste(shared, collapse = ", "),
    each = stats::setNames(ifelse(nzchar(each), each, names), names)
  )
}

# Diagnostics --------------------------------------------------------------------------

# Draws the numbers that an agent logs about its learning, each in a panel over the steps of the
# training. They help to find out why an agent does not learn.

diagnostics_picture <- function(x, call = rlang::caller_env()) {
  names <- names(agent_log(x$agent))
  if (!length(names)) {
    abort_wrong("type", "diagnostics", call,
                "The training has no diagnostics: {training_label(x)} logs none.",
                i = "`agent_ppo()` and other agents with a method of `agent_log()` do.")
  }
  rows <- do.call(rbind, lapply(names, function(name) {
    data.frame(steps = x$history$steps, name = name, value = x$history[[name]])
  }))
  rows$name <- factor(rows$name, names)
  # In the first, random episodes an agent may not learn yet, so it has no numbers there.
  rows <- rows[is.finite(rows$value), ]
  # If a number is constant, ggplot2 makes its axis 0.1 long, and a small number looks like 0. So
  # let the axis reach from half the number to one and a half times the number.
  spread <- stats::ave(rows$value, as.character(rows$name), FUN = function(x) diff(range(x)))
  constant <- rows[spread == 0, ]
  ggplot2::ggplot(rows, ggplot2::aes(.data$steps, .data$value)) +
    ggplot2::geom_blank(ggplot2::aes(y = 0.5 * .data$value), constant) +
    ggplot2::geom_blank(ggplot2::aes(y = 1.5 * .data$value), constant) +
    ggplot2::geom_line(colour = gym_colours[["blue"]], linewidth = 0.6) +
    ggplot2::geom_point(colour = gym_colours[["blue"]], size = 0.6) +
    ggplot2::facet_wrap(ggplot2::vars(.data$name), scales = "free_y", ncol = 2L) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA), n.breaks = 4) +
    number_axis(
      ggplot2::scale_y_continuous, n.breaks = 4, guide = ggplot2::guide_axis(check.overlap = TRUE)
    ) +
    picture_labels(trainings_title(list(x)), x = training_steps_label, y = NULL) +
    theme_gym_panels()
}
