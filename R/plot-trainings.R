# Several trainings in one picture: with many seeds, and of several agents.

#' Plot trainings
#'
#' Shows how good the agents' own policies were over the steps of the environment: of trainings with
#' several seeds ([gym_trainings]) the median of the seeds as a line and the middle half of them as
#' a band, of a single training its evaluations as a line; the target is a dashed line. Several that
#' are given together are compared in one picture.
#'
#' Between two evaluations a training's return is taken from the straight line between them, and
#' from its end on it stays what its final evaluation found. A picture begins where all seeds were
#' evaluated once.
#'
#' `autoplot()` makes the picture, a ggplot, to which scales, themes and layers can be added;
#' `plot()` prints it, too.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object Trainings, as `train_agent(seeds = )` returns them. It may have another name,
#'   that of its line, as in `plot(ARS = first, CEM = second)`.
#' @param ... Further trainings to compare, of class `gym_trainings` or `gym_training`, with the
#'   names of their lines or without.
#' @param main The title; `NULL`, the default, names environment, agent and number of seeds.
#' @return A ggplot; of `plot()` invisibly.
#' @section Errors: `gym_error_argument` when a training was never evaluated.
#' @rdname plot.gym_trainings
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' ars <- train_agent(agent_ars(), "CartPole-v1", iterations = 10, eval_every = 2, seeds = 1:4)
#' plot(ars)
#' hill <- train_agent(agent_hill_climb(candidates = 16), "CartPole-v1", iterations = 10,
#'                     eval_every = 2, seeds = 1:4)
#' plot(ARS = ars, `hill climbing` = hill)
autoplot.gym_trainings <- function(object, ...) {
  trainings_picture(given_trainings(arguments_as_written(quote(object))))
}

trainings_picture <- function(trainings, call = rlang::caller_env()) {
  curves <- do.call(rbind, Map(trainings_curve, trainings, names(trainings), list(call)))
  curves$label <- factor(curves$label, names(trainings))
  target <- common_target(trainings)
  alone <- curves[curves$label %in% names(which(table(curves$label) == 1L)), ]
  seeds <- any(vapply(trainings, inherits, NA, "gym_trainings"))
  marks <- lapply(named_colours(names(trainings)), function(colour) {
    list(colour = colour, shape = NA, line = "solid")
  })
  ggplot2::ggplot(curves, ggplot2::aes(.data$steps, colour = .data$label)) +
    ggplot2::geom_ribbon(
      ggplot2::aes(ymin = .data$lower, ymax = .data$upper, fill = .data$label), alpha = 0.25,
      linetype = "blank", show.legend = FALSE
    ) +
    target_line(target) +
    ggplot2::geom_line(ggplot2::aes(y = .data$median), linewidth = 0.8) +
    # A line of one point is not seen.
    ggplot2::geom_pointrange(
      ggplot2::aes(y = .data$median, ymin = .data$lower, ymax = .data$upper), alone,
      show.legend = FALSE
    ) +
    ggplot2::scale_fill_manual(values = named_colours(names(trainings)), guide = "none") +
    key_of_marks(c(marks, target_mark(target))) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA)) +
    picture_labels(
      trainings_title(trainings),
      if (seeds) "line: median of the seeds, band: their middle half",
      x = training_steps_label, y = "mean return of the policy"
    ) +
    theme_gym()
}

given_trainings <- function(values, call = rlang::caller_env()) {
  if (any(vapply(values, inherits, NA, c("gym_search", "gym_searches")))) {
    gym_abort(
      c(paste("A search by `search_random()` has no evaluations that could be compared with those",
              "of a training."),
        i = "`train_agent(agent_random(), ...)` has."),
      class = "gym_error_argument", argument = "...", call = call
    )
  }
  only_results(values, c("gym_training", "gym_trainings"), call)
}

# The target that all have, `NULL` where there is none, or not the same.
common_target <- function(trainings) {
  targets <- unique(lapply(unname(trainings), function(x) as.numeric(x$target)))
  if (length(targets) == 1L && length(targets[[1L]])) finite_target(targets[[1L]])
}

# At how many places along the axis the seeds are compared.
curve_places <- 200L

trainings_curve <- function(x, label, call) {
  each <- lapply(if (inherits(x, "gym_trainings")) x$trainings else list(x), evaluation_curve)
  each <- each[vapply(each, nrow, 0L) > 0L]
  if (!length(each)) {
    gym_abort(
      paste0("There is nothing to plot: no policy of ", label, " was evaluated."),
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
  from <- max(vapply(each, function(curve) min(curve$steps), 0))
  to <- max(vapply(each, function(curve) max(curve$steps), 0))
  steps <- if (length(each) == 1L) {
    each[[1L]]$steps
  } else {
    unique(seq(min(from, to), to, length.out = curve_places))
  }
  values <- vapply(each, function(curve) {
    # With a single evaluation it stays what it was.
    if (nrow(curve) == 1L) {
      rep(curve$mean_return, length(steps))
    } else {
      stats::approx(curve$steps, curve$mean_return, steps, rule = 2L)$y
    }
  }, numeric(length(steps)))
  values <- matrix(values, nrow = length(steps))
  quantile <- function(p) apply(values, 1L, stats::quantile, probs = p, names = FALSE)
  data.frame(
    label = label, steps = steps, median = quantile(0.5), lower = quantile(0.25),
    upper = quantile(0.75), row.names = NULL
  )
}

# The evaluations of a training; of several at one place the last, which had the most episodes.
evaluation_curve <- function(training) {
  evaluations <- training$evaluations
  steps <- training$history$steps[evaluations$iteration]
  last <- !duplicated(steps, fromLast = TRUE)
  data.frame(steps = steps[last], mean_return = evaluations$mean_return[last])
}

trainings_title <- function(trainings) {
  ids <- unique(vapply(trainings, function(x) x$env_id, ""))
  if (length(trainings) > 1L) {
    return(paste(ids, collapse = ", "))
  }
  x <- trainings[[1L]]
  count <- if (inherits(x, "gym_trainings")) paste0(", ", count_of(length(x$trainings), "seed"))
  paste0(training_label(x), " in ", ids, count)
}
