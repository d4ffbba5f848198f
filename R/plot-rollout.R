#' Plot a rollout, or compare several
#'
#' Three pictures of a rollout: of all of its episodes how their returns are distributed, and
#' of one of them what was observed and done, or how it looked. Several rollouts, or one of several
#' policies, are compared: a row for each policy shows how its returns are distributed.
#'
#' `autoplot()` makes the picture, a ggplot, to which scales, themes and layers can be added;
#' `plot()` prints it, too.
#'
#' `"returns"` shows the density of the episodes' returns, the median marked, and each episode
#' as a tick on the axis. Where there are few different returns, such as the 0 and 1 of
#' FrozenLake, it shows a bar for each, as high as the number of its episodes: where there are
#' at most 3, or at most 10 that come twice on average. In a comparison each row is as high as the
#' others, whatever the numbers of episodes; of more than ten policies it shows those with the ten
#' highest mean returns.
#'
#' `"trajectory"` shows an episode's observations, each in a panel of its own, and below them its
#' actions, against the number of steps taken. Where Gymnasium's documentation has units and what
#' actions mean, the labels do, too. Dashed lines are limits at which the documentation says that
#' an episode ends (in CartPole the cart beyond 2.4 m, the pole beyond 12 degrees), drawn where
#' the episode comes near; a solid line is its end. The observations are those that the actions were
#' taken on: the one after the last step is not among them. Takes a rollout with `steps = TRUE`.
#' Where a wrapper changes what is observed, as `NormalizeObservation` does, the labels are `obs_1`
#' and so on, and there are no limits.
#'
#' `"filmstrip"` shows frames of an episode side by side, in rows where that makes them
#' larger, evenly apart, the first and the last among them. Above and below, what is blank in all
#' of them is cut off. Takes a rollout with `frames = TRUE`, and the package png.
#'
#' @param x,object What [rollout()] returned. It may have another name, which is then that of its
#'   row: `plot(random = played_1, network = played_2)`.
#' @param type `"returns"`, the default, `"trajectory"` or `"filmstrip"`.
#' @param episode Which episode to show, a whole number; the default is the first.
#' @param variables The parts of the observation to show in a trajectory: names of columns of the
#'   table of steps, such as `"pole_angle"`, also `"reward"`. `NULL`, the default, takes the
#'   first 8.
#' @param n How many frames a filmstrip has at most, a whole number; the default is 8.
#' @param candidate Whose episode to show where several policies were played, a whole number; the
#'   default is the first.
#' @param ... For `"returns"` further rollouts to compare, with the names of their rows or without.
#'   Further arguments of `plot()` are those of `autoplot()`.
#' @param main The title; `NULL`, the default, names the environment.
#' @param xlab,ylab The axes' labels, strings; `NULL`, the default, for the picture's own.
#' @param xlim,ylim The part of the axes to show, two numbers each; `NULL`, the default, for all.
#' @return A ggplot; of `plot()` invisibly.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, and for a
#'   rollout that was played without the steps or frames that are to be shown.
#' @references The density is that of [stats::density()] with its default bandwidth, within
#'   the range of the returns, as in the figure of the tutorial *Artificial Intelligence in R (I)*
#'   (2018).
#' @seealso [animate()] for a moving picture.
#' @rdname plot.gym_rollout
#' @exportS3Method ggplot2::autoplot
#' @examplesIf gym:::can_start_server()
#' random <- rollout("CartPole-v1", policy_random(), episodes = 50, seed = 1)
#' plot(random)
#'
#' # As any picture of ggplot2.
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
  if (type != "returns") check_single_rollout(rollouts, type)
  switch(type,
    returns = if (is_comparison(rollouts)) comparison_picture(rollouts) else returns_picture(x),
    trajectory = trajectory_picture(x, trajectory_plot_data(x, episode, variables, candidate)),
    filmstrip = filmstrip_picture(x, episode, n, candidate)
  )
}

given_rollouts <- function(values, call = rlang::caller_env()) {
  rollouts <- only_results(values, "gym_rollout", call)
  check_have_episodes(rollouts, call)
  rollouts
}

check_have_episodes <- function(rollouts, call) {
  for (rollout in rollouts) {
    if (!nrow(rollout$episodes)) {
      gym_abort(
        c(paste0("A rollout in ", rollout$env_id, " has no episode to plot: it was interrupted ",
                 "before the first batch of episodes had ended."),
          i = "The same call of `rollout()` with its `seed` plays it again."),
        class = "gym_error_argument", argument = "x", value = rollout, call = call
      )
    }
  }
}

check_single_rollout <- function(rollouts, type, call = rlang::caller_env()) {
  if (length(rollouts) > 1L) {
    gym_abort(
      paste0("A ", type, " shows one rollout, not ", length(rollouts), "."),
      class = "gym_error_argument", argument = "...", call = call
    )
  }
}

is_comparison <- function(rollouts) {
  length(rollouts) > 1L || !is.null(rollouts[[1L]]$episodes$candidate)
}
