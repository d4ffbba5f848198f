#' Plot a rollout, or compare several
#'
#' Show the returns of all episodes of a rollout, the observations and actions of one episode, or
#' the frames of one episode. With several rollouts, or a rollout of several policies, the picture
#' compares the policies: each has a row with the distribution of its returns. Each environment has
#' its own column.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' `"returns"` shows the density of the returns, with the median marked, and each episode as a tick
#' on the axis. Returns that are whole numbers have a histogram of episodes, with a bar for each
#' number if there are at most 40 from the smallest to the largest. If there are only few different
#' returns, such as the 0 and 1 of FrozenLake, each has a bar: for up to 3 different returns, and
#' for up to 10 if each occurs twice on average. In a comparison all rows have the same height. If
#' there are more than ten policies, the picture shows the ten with the highest mean returns.
#'
#' `"trajectory"` shows each part of an episode's observations in a panel, and the actions below
#' them, over the steps of the episode. This needs a rollout with `steps = TRUE`. The labels use the
#' units and the meanings of actions in Gymnasium's documentation. Dashed lines are limits at which
#' an episode ends, from the same documentation (in CartPole the cart at 2.4 m and the pole at 12
#' degrees). A limit is drawn only if the episode comes near. A solid line marks the end. The
#' picture shows the observation before each action, so the last observation is missing. If a
#' wrapper changes observations, as `NormalizeObservation` does, the labels are `obs_1` and so on,
#' without limits.
#'
#' `"filmstrip"` shows evenly spaced frames of an episode, including the first and the last, four in
#' a row, or two if they are wide. A blank border is cut off if all frames have it. This needs a
#' rollout with `frames = TRUE`, and the package png.
#'
#' @param x,object The result of [rollout()]. You may give the argument another name, which then
#'   names its row: `plot(random = played_1, network = played_2)`.
#' @param type `"returns"`, the default, `"trajectory"` or `"filmstrip"`.
#' @param episode The episode to show, a whole number. The default is the first.
#' @param variables The parts of the observation in a trajectory: names of columns of the table of
#'   steps, such as `"pole_angle"` or `"reward"`. `NULL`, the default, shows the first 8 parts.
#' @param n The largest number of frames in a filmstrip, a whole number. The default is 8.
#' @param candidate The candidate whose episode to show, if several policies were played, a whole
#'   number. The default is the first.
#' @param ... For `"returns"`, further rollouts to compare, optionally with names for their rows.
#'   `plot()` passes its arguments to `autoplot()`.
#' @param main The title. `NULL`, the default, names the environment.
#' @param xlab,ylab The axes' labels, strings. `NULL`, the default, keeps those of the picture.
#' @param xlim,ylim The ranges of the axes to show, two numbers each. `NULL`, the default, shows
#'   everything.
#' @param guide `"none"` draws the picture without its key. `NULL`, the default, draws it.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` for an invalid argument, or a rollout without the steps or
#'   frames to be shown.
#' @references The density is that of [stats::density()] with its default bandwidth, over the range
#'   of the returns, as in the figure of the tutorial *Artificial Intelligence in R (I)* (2018).
#' @seealso [animate()] for an animation.
#' @rdname plot.gym_rollout
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' random <- rollout("CartPole-v1", policy_random(), episodes = 50, seed = 1)
#' plot(random)
#'
#' # Change it like any ggplot.
#' library(ggplot2)
#' autoplot(random) + theme_bw() + labs(title = "Chance")
#'
#' # The pole falls to the right: push the cart to the right.
#' follow_pole <- function(observation) as.integer(observation[, "pole_angle"] > 0)
#' follow <- rollout("CartPole-v1", follow_pole, episodes = 50, seed = 1)
#' plot(random = random, `follow the pole` = follow)
#' policies <- list(random = policy_random(), follow = follow_pole)
#' plot(rollout("CartPole-v1", policies, episodes = 50, seed = 1))
#'
#' played <- rollout("CartPole-v1", follow_pole, seed = 1, steps = TRUE, frames = TRUE)
#' plot(played, type = "trajectory")
#' if (requireNamespace("png", quietly = TRUE)) plot(played, type = "filmstrip")
autoplot.gym_rollout <- function(object, ..., type = c("returns", "trajectory", "filmstrip"),
                                 episode = 1, variables = NULL, n = 8, candidate = 1) {
  type <- check_choice(type[1L], c("returns", "trajectory", "filmstrip"), arg = "type")
  rollouts <- given_rollouts(arguments_as_written(quote(object)))
  x <- rollouts[[1L]]
  several <- length(rollouts) > 1L
  if (several && type != "returns") {
    abort_wrong("...", NULL, rlang::current_env(),
                "A {type} shows one rollout, not {length(rollouts)}.")
  }
  comparison <- several || !is.null(x$episodes$candidate)
  switch(type,
    returns = if (comparison) comparison_picture(rollouts) else returns_picture(x),
    trajectory = trajectory_picture(x, trajectory_plot_data(x, episode, variables, candidate)),
    filmstrip = {
      check_count(n)
      stills <- pick_stills(episode_frames(x, episode, candidate), n)
      check_suggested("png", "draw a filmstrip")
      filmstrip(stills)
    }
  )
}

given_rollouts <- function(values, call = rlang::caller_env()) {
  rollouts <- only_results(values, "gym_rollout", call)
  for (rollout in rollouts) {
    if (!nrow(rollout$episodes)) {
      abort_wrong("x", rollout, call,
                  "A rollout in {env_text(rollout)} has no episode to plot: it was interrupted
                   before the first batch of episodes had ended.",
                  i = "The same call of `rollout()` with its `seed` plays it again.")
    }
  }
  rollouts
}

# Returns ------------------------------------------------------------------------------

# Draws the distribution of the returns of a rollout's episodes.

returns_picture <- function(x) {
  returns <- x$episodes$return
  kind <- returns_kind(returns)
  counts <- kind != "density"
  draw <- function(geom, ...) {
    geom(fill = gym_colours[["sky"]], alpha = 0.6, colour = gym_colours[["blue"]], ...)
  }
  ggplot2::ggplot(data.frame(value = returns), ggplot2::aes(.data$value)) +
    switch(
      kind,
      bars = list(
        draw(ggplot2::geom_bar, width = bar_width(returns), position = "identity"),
        ggplot2::scale_x_continuous(
          breaks = bar_marks(returns) %||% ggplot2::waiver(),
          # A single bar must not fill the picture.
          expand = ggplot2::expansion(mult = if (length(unique(returns)) == 1L) 2 else 0.05)
        )
      ),
      histogram = list(
        draw(ggplot2::geom_histogram, binwidth = bin_width(returns), boundary = max(returns) + 0.5),
        ggplot2::scale_x_continuous(breaks = few_breaks)
      ),
      density = list(
        draw(ggplot2::geom_density), ggplot2::geom_rug(sides = "b", colour = gym_colours[["blue"]])
      )
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

# Bins are whole numbers wide. The last bin ends at the largest return, because this may be the
# largest possible return.
bin_width <- function(returns) max(1, ceiling((diff(range(returns)) + 1) / most_bins))

most_bins <- 40L

# With few different returns a density would show values that no episode had, so use bars.
most_bars <- 10L

has_few <- function(returns) {
  length(unique(returns)) <= min(most_bars, max(3, length(returns) / 2))
}

# How to draw returns: a few different ones as bars, other whole numbers as a histogram.
returns_kind <- function(returns) {
  if (has_few(returns)) "bars" else if (all_whole(returns)) "histogram" else "density"
}

# Bars are as wide as the two nearest values allow; for whole numbers the width is at most 1. But
# bars are always wide enough to see among `all` values.
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
