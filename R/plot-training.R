#' Plot a training
#'
#' Show a training over the steps of the environment. The band is the range of the returns of each
#' iteration (of its candidates, or of its episodes for an agent that learns from steps), and the
#' line is their median. Points are evaluations of the agent's own policy. The dashed line is the
#' target. The filled point at the end is the final evaluation, with its interval.
#'
#' `type = "diagnostics"` shows the numbers that the agent logs (see [agent_log()]), one per panel.
#' For PPO (see [agent_ppo()]): the policy moves too far in an iteration if `approx_kl` is far above
#' 0.02, it has stopped exploring if `entropy_loss` is close to 0, and the value network predicts
#' nothing if `explained_variance` stays near 0.
#'
#' Several trainings are compared as in [plot.gym_trainings()].
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A training, as returned by [train_agent()]. You may give it another name, which
#'   is then the name of its line, as in `plot(ARS = first, CEM = second)`.
#' @param main The title. `NULL`, the default, names the environment and the agent.
#' @param type What to show, a string: `"returns"`, the default, or `"diagnostics"`, for a single
#'   training.
#' @param ... Further trainings to compare, optionally with names for their lines.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if no iteration was played to its end.
#' @rdname plot.gym_training
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' trained <- train_agent(agent_ars(), "CartPole-v1", iterations = 20, seed = 1)
#' plot(trained)
autoplot.gym_training <- function(object, ..., type = c("returns", "diagnostics")) {
  type <- check_choice(type[1L], c("returns", "diagnostics"), arg = "type")
  trainings <- given_trainings(arguments_as_written(quote(object)))
  if (length(trainings) > 1L && type == "returns") {
    return(trainings_picture(trainings))
  }
  check_one_training(trainings, type)
  x <- trainings[[1L]]
  check_has_history(x)
  if (type == "diagnostics") {
    return(diagnostics_picture(x))
  }
  evaluations <- placed_evaluations(x)
  final <- evaluations[evaluations$kind == "final", ]
  target <- finite_target(x$target)
  range <- paste("range of", returned_unit(x$agent))
  ggplot2::ggplot(x$history, ggplot2::aes(.data$steps)) +
    ggplot2::geom_ribbon(
      ggplot2::aes(ymin = .data$min_return, ymax = .data$max_return, colour = range),
      fill = gym_colours[["sky"]], alpha = 0.6, linetype = "blank", key_glyph = "point"
    ) +
    target_line(target) +
    ggplot2::geom_line(
      ggplot2::aes(y = .data$median_return, colour = "their median"), linewidth = 0.8
    ) +
    ggplot2::geom_point(
      ggplot2::aes(y = .data$mean_return, colour = "the policy"),
      evaluations[evaluations$kind != "final", ], shape = 1, size = 2, stroke = 1
    ) +
    ggplot2::geom_linerange(
      ggplot2::aes(ymin = .data$lower, ymax = .data$upper, colour = "final evaluation"), final,
      linewidth = 0.8, show.legend = FALSE, na.rm = TRUE
    ) +
    ggplot2::geom_point(
      ggplot2::aes(y = .data$mean_return, colour = "final evaluation"), final, size = 3
    ) +
    key_of_marks(c(
      stats::setNames(list(key_mark("sky", shape = 15)), range),
      list(`their median` = key_mark("blue", line = "solid")),
      if (nrow(evaluations) > nrow(final)) list(`the policy` = key_mark("brown", shape = 1)),
      if (nrow(final)) list(`final evaluation` = key_mark("brown", shape = 16)),
      target_mark(target)
    )) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA)) +
    picture_labels(trainings_title(list(x)), x = training_steps_label, y = "return") +
    theme_gym()
}

check_one_training <- function(trainings, type, call = rlang::caller_env()) {
  if (length(trainings) > 1L) {
    gym_abort(
      paste0("A picture of ", type, " shows one training, not ", length(trainings), "."),
      class = "gym_error_argument", argument = "type", value = type, call = call
    )
  }
}

check_has_history <- function(x, call = rlang::caller_env()) {
  if (!NROW(x$history)) {
    gym_abort(
      "There is nothing to plot: the training ended before its first iteration did.",
      class = "gym_error_argument", argument = "x", value = x, call = call
    )
  }
}

# The evaluations and their places in steps. Of several final ones the last counts.
placed_evaluations <- function(x) {
  evaluations <- x$evaluations
  evaluations$steps <- evaluation_steps(x)
  earlier <- evaluations$kind == "final" & duplicated(evaluations$kind, fromLast = TRUE)
  evaluations[!earlier, ]
}
