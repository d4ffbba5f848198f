#' Plot a training
#'
#' Show a training over the steps of the environment. The band is the range of the returns of each
#' iteration (the returns of its candidates, or of its episodes if the agent learns from steps), and
#' the line is the median return. Points are evaluations of the agent's own policy. The dashed line
#' is the target. The filled point at the end is the final evaluation, with its interval.
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
#' @param x,object A training, as returned by [train_agent()]. You may give the argument another
#'   name, which then names its line, as in `plot(ARS = first, CEM = second)`.
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
  if (length(trainings) > 1L) {
    abort_wrong("type", type, rlang::current_env(),
                "A picture of {type} shows one training, not {length(trainings)}.")
  }
  x <- trainings[[1L]]
  if (!NROW(x$history)) {
    abort_wrong("x", x, rlang::current_env(),
                "There is nothing to plot: the training ended before its first iteration did.")
  }
  if (type == "diagnostics") {
    return(diagnostics_picture(x))
  }
  evaluations <- x$evaluations
  evaluations$steps <- evaluation_steps(x)
  # If there are several final evaluations, show the last one.
  earlier <- evaluations$kind == "final" & duplicated(evaluations$kind, fromLast = TRUE)
  evaluations <- evaluations[!earlier, ]
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
      if (nrow(final)) list(`final evaluation` = key_mark("brown", shape = 16)), target_mark(target)
    )) +
    number_axis(ggplot2::scale_x_continuous, limits = c(0, NA)) +
    picture_labels(trainings_title(list(x)), x = training_steps_label, y = "return") +
    theme_gym()
}

# Searches -----------------------------------------------------------------------------

#' Plot a search
#'
#' Show every episode of a search as a point, the mean of each round as a line, and the target as a
#' dashed line. Points with almost the same return in the same round are side by side.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A search, as returned by [search_random()].
#' @param type What to show: `"returns"`, the default; or `"network"`, the best policy, by
#'   [plot.gym_policy_network()].
#' @param main The title. `NULL`, the default, describes the search.
#' @param ... Arguments of the network's picture. `plot()` passes its arguments to `autoplot()`.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if no round was played to its end.
#' @rdname plot.gym_search
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search)
#' plot(search, type = "network")
autoplot.gym_search <- function(object, type = c("returns", "network"), ...) {
  type <- check_choice(type[1L], c("returns", "network"), arg = "type")
  if (type == "network") {
    check_found(object)
    return(autoplot.gym_policy_network(object$policy, ...))
  }
  check_dots_empty(...)
  means <- object$rounds
  if (!nrow(means)) {
    abort_wrong("x", object, rlang::current_env(),
                "There is nothing to plot: the search ended before its first round was played to
                 its end.")
  }
  outcome <- if (object$solved) {
    paste("solved in round", object$round)
  } else if (!is.null(object$target)) {
    paste("not solved in", count_of(nrow(means), "round"))
  }
  target <- finite_target(object$target)
  ggplot2::ggplot(object$episodes, ggplot2::aes(.data$round, .data$return)) +
    target_line(target) +
    # With its own seed, the jitter leaves R's generator unchanged.
    ggplot2::geom_point(
      ggplot2::aes(colour = "episode"), size = 1.8,
      position = ggplot2::position_jitter(width = 0.25, height = 0, seed = 1)
    ) +
    # For a line of one point ggplot2 shows a message, so leave it out.
    (if (nrow(means) > 1L) ggplot2::geom_line(
      ggplot2::aes(.data$round, .data$mean_return, colour = "mean of the round"), means,
      linewidth = 0.7
    )) +
    ggplot2::geom_point(
      ggplot2::aes(.data$round, .data$mean_return, colour = "mean of the round"), means, shape = 15
    ) +
    key_of_marks(c(
      list(
        episode = key_mark("sky", shape = 16),
        `mean of the round` = key_mark("blue", shape = 15, line = "solid")
      ),
      target_mark(target)
    )) +
    ggplot2::scale_x_continuous(breaks = function(limits) unique(round(few_breaks(limits)))) +
    picture_labels(
      paste("Random search in", env_text(object)), outcome, x = "round", y = "return"
    ) +
    theme_gym()
}

# Bandits ------------------------------------------------------------------------------

#' Plot what bandit learners achieved
#'
#' Show the mean reward of all learners at each step, or the share of learners that took the best
#' arm. Give several results to compare them.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object The result of [learn_bandit()].
#' @param ... Further results, optionally with names for the key. `plot()` passes its arguments to
#'   `autoplot()`.
#' @param what What to show, a string: `"mean_reward"`, the default, or `"best_share"`.
#' @param main The title. `NULL`, the default, names the bandit.
#' @return A ggplot. `plot()` returns it invisibly.
#' @rdname plot.gym_bandit_learning
#' @exportS3Method ggplot2::autoplot
#' @examples
#' testbed <- bandit(arms = 10, horizon = 200)
#' few <- learn_bandit(testbed, epsilon = 0.01, learners = 200, seed = 1)
#' many <- learn_bandit(testbed, epsilon = 0.1, learners = 200, seed = 1)
#' plot(few, many, what = "best_share")
autoplot.gym_bandit_learning <- function(object, ..., what = c("mean_reward", "best_share")) {
  # If all results have names, even the first one is in the dots.
  runs <- if (missing(object)) list(...) else list(object, ...)
  what <- check_choice(what[1L], c("mean_reward", "best_share"), arg = "what")
  curves <- bandit_curves(runs, what)
  share <- what == "best_share"
  ggplot2::ggplot(curves, ggplot2::aes(.data$step, .data$value, colour = .data$learner)) +
    ggplot2::geom_line(linewidth = 0.5) +
    ggplot2::scale_colour_manual(
      name = NULL, values = named_colours(levels(curves$learner)),
      guide = rows_of_key(levels(curves$learner), override.aes = list(linewidth = 1))
    ) +
    number_axis(ggplot2::scale_x_continuous) +
    ggplot2::scale_y_continuous(limits = if (share) c(0, 1)) +
    picture_labels(
      runs[[1L]]$env_id, x = "step",
      y = if (share) "share that takes the best arm" else "mean reward"
    ) +
    theme_gym()
}

bandit_curves <- function(runs, what, call = rlang::caller_env()) {
  for (i in seq_along(runs)) {
    if (!inherits(runs[[i]], "gym_bandit_learning")) {
      abort_argument(runs[[i]], "what `learn_bandit()` returns", paste0("..", i), call)
    }
  }
  given <- rlang::names2(runs)
  labels <- vapply(runs, function(run) run$label, "")
  labels <- make.unique(ifelse(nzchar(given), given, labels), sep = ", again ")
  curves <- do.call(rbind, Map(function(run, label) {
    data.frame(step = run$curve$step, value = run$curve[[what]], learner = label, row.names = NULL)
  }, runs, labels))
  curves$learner <- factor(curves$learner, unname(labels))
  curves
}
