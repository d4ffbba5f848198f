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
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object Trainings, as `train_agent(seeds = )` returns them. It may have another name,
#'   that of its line, as in `plot(ARS = first, CEM = second)`.
#' @param ... Further trainings to compare, of class `gym_trainings` or `gym_training`, with the
#'   names of their lines or without; and further arguments of
#'   [plot()][graphics::plot.default()], such as `ylim`, which `autoplot()` does not take.
#' @param main The title; the default names environment, agent and number of seeds.
#' @param xlab,ylab The axes' labels.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when a training was never evaluated.
#' @export
#' @examplesIf gym:::can_start_server()
#' ars <- train_agent(agent_ars(), "CartPole-v1", iterations = 10, eval_every = 2, seeds = 1:4)
#' plot(ars)
#' hill <- train_agent(agent_hill_climb(candidates = 16), "CartPole-v1", iterations = 10,
#'                     eval_every = 2, seeds = 1:4)
#' plot(ARS = ars, `hill climbing` = hill)
plot.gym_trainings <- function(x, ..., main = NULL, xlab = NULL, ylab = NULL) {
  given <- if (missing(x)) {
    given_trainings(list(...), substitute(list(...)))
  } else {
    given_trainings(list(x, ...), substitute(list(x, ...)))
  }
  draw_trainings(given, main, xlab, ylab)
  invisible(given$trainings[[1L]])
}

training_steps_label <- "steps of the environment"

# Tells the trainings among the arguments of a plot from the others.
given_trainings <- function(dots, written, call = rlang::caller_env()) {
  check_no_search(dots, call)
  are <- vapply(dots, is_training, NA)
  names <- rlang::names2(dots)
  unnamed <- which(!are & !nzchar(names))
  if (length(unnamed)) {
    abort_argument(dots[[unnamed[[1L]]]], "trainings, or have a name", "...", call)
  }
  expressions <- as.list(written)[-1L][are]
  list(
    trainings = stats::setNames(
      dots[are], argument_labels(dots[are], names[are], expressions, training_label)
    ),
    others = dots[!are]
  )
}

is_training <- function(x) inherits(x, c("gym_training", "gym_trainings"))

check_no_search <- function(dots, call) {
  if (any(vapply(dots, inherits, NA, c("gym_search", "gym_searches")))) {
    gym_abort(
      c(paste("A search by `search_random()` has no evaluations that could be compared with those",
              "of a training."),
        i = "`train_agent(agent_random(), ...)` has."),
      class = "gym_error_argument", argument = "...", call = call
    )
  }
}

training_label <- function(x) sub(":.*", "", format(x$agent))

#' Compute what a plot of several trainings shows
#' @param trainings A list of objects of class `gym_training` or `gym_trainings`, with names.
#' @return A list: `curves`, a data frame with the columns `label`, `steps`, `median`, `lower` and
#'   `upper` (the middle half of the seeds); `colours`, named by the labels; `target` (`NULL` where
#'   there is none, or not the same), `title`, `xlim`, `ylim`.
#' @noRd
trainings_plot_data <- function(trainings, call = rlang::caller_env()) {
  curves <- do.call(rbind, Map(trainings_curve, trainings, names(trainings), list(call)))
  targets <- unique(lapply(unname(trainings), function(x) as.numeric(x$target)))
  target <- if (length(targets) == 1L && length(targets[[1L]])) targets[[1L]]
  target <- if (!is.null(target) && is.finite(target)) target
  list(
    curves = curves,
    colours = stats::setNames(
      rep_len(setdiff(line_colours, okabe_ito$vermillion), length(trainings)), names(trainings)
    ),
    target = target, title = trainings_title(trainings),
    xlim = c(0, max(curves$steps)), ylim = range(curves$lower, curves$upper, target)
  )
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

draw_trainings <- function(given, main, xlab, ylab) {
  data <- trainings_plot_data(given$trainings)
  open_plot(
    list(x = data$xlim, y = data$ylim, xlab = xlab %||% training_steps_label,
         ylab = ylab %||% returns_label),
    given$others
  )
  if (!is.null(data$target)) {
    graphics::abline(h = data$target, col = okabe_ito$vermillion, lty = "dashed", lwd = 2)
  }
  for (curve in split(data$curves, data$curves$label)) {
    colour <- data$colours[[curve$label[[1L]]]]
    graphics::polygon(
      c(curve$steps, rev(curve$steps)), c(curve$lower, rev(curve$upper)), border = NA,
      col = grDevices::adjustcolor(colour, 0.25)
    )
  }
  for (curve in split(data$curves, data$curves$label)) {
    colour <- data$colours[[curve$label[[1L]]]]
    graphics::lines(curve$steps, curve$median, col = colour, lwd = 2)
    # A line of one point is not seen.
    if (nrow(curve) == 1L) {
      graphics::segments(curve$steps, curve$lower, curve$steps, curve$upper, col = colour, lwd = 2)
      graphics::points(curve$steps, curve$median, pch = 16L, col = colour)
    }
  }
  title_above(main %||% data$title)
  targets <- if (!is.null(data$target)) paste("target", number_text(data$target))
  count <- length(data$colours)
  legend_above(
    labels = c(names(data$colours), targets),
    col = c(unname(data$colours), if (length(targets)) okabe_ito$vermillion),
    pch = rep(NA, count + length(targets)),
    lty = c(rep("solid", count), if (length(targets)) "dashed")
  )
}

#' @rdname plot.gym_trainings
#' @exportS3Method ggplot2::autoplot
autoplot.gym_trainings <- function(object, ...) {
  given <- if (missing(object)) {
    given_trainings(list(...), substitute(list(...)))
  } else {
    given_trainings(list(object, ...), substitute(list(object, ...)))
  }
  rlang::exec(check_dots_empty, !!!given$others)
  autoplot_trainings(given$trainings)
}

autoplot_trainings <- function(trainings) {
  data <- trainings_plot_data(trainings)
  data$curves$label <- factor(data$curves$label, names(data$colours))
  plot <- ggplot2::ggplot(data$curves, ggplot2::aes(x = .data$steps, colour = .data$label)) +
    ggplot2::geom_ribbon(
      ggplot2::aes(ymin = .data$lower, ymax = .data$upper, fill = .data$label), alpha = 0.25,
      colour = NA
    ) +
    ggplot2::geom_line(ggplot2::aes(y = .data$median), linewidth = 0.8) +
    ggplot2::geom_pointrange(
      ggplot2::aes(y = .data$median, ymin = .data$lower, ymax = .data$upper),
      data$curves[data$curves$label %in% names(which(table(data$curves$label) == 1L)), ]
    ) +
    ggplot2::scale_colour_manual(values = data$colours, aesthetics = c("colour", "fill")) +
    ggplot2::labs(
      title = data$title, x = training_steps_label, y = returns_label, colour = NULL, fill = NULL,
      subtitle = "line: median of the seeds; band: the middle half of them; dashed: target"
    )
  if (is.null(data$target)) {
    plot
  } else {
    plot + ggplot2::geom_hline(yintercept = data$target, colour = okabe_ito$vermillion,
                               linetype = "dashed", linewidth = 0.8)
  }
}
