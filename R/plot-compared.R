#' Plot a comparison of trainings
#'
#' Show a comparison. For scores: the mean, median and interquartile mean of each training with
#' their intervals (`type = "scores"`, the default), the performance profiles (`"profile"`), or the
#' probabilities that one training scores higher than another (`"improvement"`). For steps to a
#' target: the share of runs that have reached it, over the steps of the training, with its
#' interval. Ticks are the ends of runs that failed or were interrupted.
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
    switch(type, scores = scores_picture(object), profile = profile_picture(object),
           improvement = improvement_picture(object))
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

statistic_names <- c(mean = "mean", median = "median", iqm = "interquartile mean")

# Rows whose names fit a third of four inches.
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
      ggplot2::vars(.data$statistic), ncol = 1L, labeller = ggplot2::as_labeller(statistic_names)
    ) +
    ggplot2::scale_colour_manual(values = named_colours(unique(x$table$training)), guide = "none") +
    named_rows() +
    picture_labels(x = score_label(x), y = NULL)
}

# Lines with bands over scores or steps.
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

profile_picture <- function(x) {
  shares_picture(x$profile, "score", ggplot2::geom_step(direction = "hv", linewidth = 0.8)) +
    picture_labels(x = score_label(x), y = "share of runs that score more")
}

improvement_picture <- function(x) {
  rows <- x$improvement
  if (is.null(rows)) {
    gym_abort("There is one training: none could score higher than another.",
              class = "gym_error_argument", argument = "type", value = "improvement", call = NULL)
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
  # Steps drawn with corners, so that the band has them, too.
  rows <- do.call(rbind, lapply(split(x$profile, list(x$profile$training, x$profile$env_id),
                                      drop = TRUE), function(rows) {
    n <- nrow(rows)
    corners <- rows[rep(seq_len(n), each = 2L)[-2L * n], ]
    corners$steps <- rows$steps[rep(seq_len(n), each = 2L)[-1L]]
    corners
  }))
  failed <- x$runs[!x$runs$reached, ]
  at <- match_profile(failed, x$profile)
  failed$share <- x$profile$share[at]
  failed$training <- factor(failed$training, unique(x$runs$training))
  picture <- shares_picture(
    rows[order(match(rows$training, unique(x$runs$training))), ], "steps",
    ggplot2::geom_path(linewidth = 0.8)
  )
  picture +
    ggplot2::geom_point(data = failed, shape = 3, show.legend = FALSE) +
    (if (length(unique(rows$env_id)) > 1L) {
      ggplot2::facet_wrap(
        ggplot2::vars(.data$env_id), scales = "free_x", labeller = ggplot2::as_labeller(x$envs)
      )
    }) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA)) +
    picture_labels(x = training_steps_label, y = "share that reached the target")
}

match_profile <- function(runs, profile) {
  key <- function(rows) paste(rows$training, rows$env_id, rows$steps, sep = "\r")
  match(key(runs), key(profile))
}
