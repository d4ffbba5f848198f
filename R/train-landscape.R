#' Play the networks around the best one
#'
#' Compute the landscape of a search: the mean return over a plane through the weights of the best
#' policy, which is in the middle. Each point of the plane is a network, and all networks play the
#' same few episodes. [plot()][plot.gym_landscape()] shows the landscape.
#' `plot(search, type = "landscape")` does both in one call, but plays every time.
#'
#' # The plane
#'
#' Two random directions span the plane. In each, the weights into a neuron are scaled to the length
#' of those of the best network, as Li et al. (2018) do with filters. A step of 1 then changes each
#' neuron as much as its own weights. If a neuron has two inputs or more, the second direction is
#' perpendicular to the first. (In networks with millions of weights two random directions are
#' nearly perpendicular; in small ones they are not.) The point `(a, b)` has the best weights plus
#' `a` times the first and `b` times the second direction. A network with a Gaussian output keeps
#' the standard deviations of the best policy at each point.
#'
#' # The same episodes
#'
#' All networks play episodes with the same seeds, so that neighbours differ by their weights and
#' not by chance. There is one exception: if R steps sub-environments that share a seed
#' (`"CartPole-v1"` made with `num_envs`, by its own vector implementation), each network plays
#' other episodes. The element `common` of the result is then `FALSE`.
#'
#' @param search A search, as returned by [search_random()]. If it got the environment as an object,
#'   that must still be open.
#' @param size The number of points in each direction, an odd whole number of at least 3. The
#'   default is 21, which gives 441 networks.
#' @param span How far the plane reaches to each side of the middle, in lengths of the best weights,
#'   a number above 0. The default is 1.
#' @param episodes The number of episodes of each network, a whole number of at least 1. The default
#'   is 5.
#' @param seed A whole number that fixes directions and episodes and leaves the session's generator
#'   as it was. `NULL`, the default, draws a seed from the session's generator.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the search's client.
#' @return An object of class `gym_landscape`, with methods for [print()], [as.data.frame()] and
#'   [plot()][plot.gym_landscape()]. It is a list with the elements
#'   \describe{
#'     \item{grid}{A data frame with one row for each point: `a`, `b` (doubles, its coordinates) and
#'       `mean_return` (double, `NA` if it was not played because of an interrupt).
#'       `as.data.frame()` returns it.}
#'     \item{best}{The mean return of the best policy in these episodes, a double.}
#'     \item{directions}{The two directions, each a list of matrices in the form of the `weights` of
#'       a [policy_network()].}
#'     \item{policy, env_id, target}{The best policy, and the environment and target of the search.}
#'     \item{episodes, seeds, common}{The number of episodes of each network, an integer; their
#'       seeds, integers; and whether they were the same for all, a logical.}
#'     \item{elapsed, interrupted}{The time it took in seconds, a double, and whether it was
#'       interrupted, a logical.}
#'   }
#' @section Errors: `gym_error_argument` if the search has no policy because it was stopped in its
#'   first round. Those of [rollout()] while it plays.
#' @references H. Li, Z. Xu, G. Taylor, C. Studer, T. Goldstein (2018): Visualizing the Loss
#'   Landscape of Neural Nets. *Advances in Neural Information Processing Systems* 31.
#' @export
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' landscape <- search_landscape(search, size = 5, episodes = 2, seed = 1)
#' landscape
#' plot(landscape)
search_landscape <- function(search, size = 21, span = 1, episodes = 5, seed = NULL,
                             progress = rlang::is_interactive(),
                             client = search$client %||% gym_client()) {
  if (!inherits(search, "gym_search")) {
    abort_argument(search, "a search made by `search_random()`", "search",
                   rlang::current_env())
  }
  check_found(search)
  check_odd(size)
  check_above_zero(span)
  check_count(episodes)
  check_seed(seed)
  check_flag(progress)
  streams <- new_streams(seed %||% draw_seed())
  directions <- with_generator(streams$agent, draw_directions(search$policy$weights))
  plane <- new_plane(search$policy, directions, size, span)
  play <- function(vector_env) {
    play_plane(vector_env, plane, search, as.integer(episodes), streams, progress)
  }
  env <- search$env %||% search$env_id
  with_vector_env(env, as.numeric(size)^2 * episodes, play, client = client)
}

check_odd <- function(size, call = rlang::caller_env()) {
  check_count(size, min = 3, call = call)
  if (size %% 2 == 0) {
    abort_argument(size, "odd, so that the best policy lies in the middle", "size", call)
  }
}

# The plane -----------------------------------------------------------------------

#' Draw two directions through weights
#' @return A list of two lists of matrices.
#' @noRd
draw_directions <- function(weights) {
  draw <- function() lapply(weights, function(layer) layer * 0 + stats::rnorm(length(layer)))
  first <- draw()
  second <- Map(perpendicular, draw(), first)
  list(Map(as_long_as, first, weights), Map(as_long_as, second, weights))
}

# For each neuron (a row). A neuron with one input has no perpendicular direction.
perpendicular <- function(layer, to) {
  if (ncol(layer) < 2L) {
    return(layer)
  }
  layer - to * (rowSums(layer * to) / rowSums(to^2))
}

as_long_as <- function(direction, layer) {
  direction * (sqrt(rowSums(layer^2)) / sqrt(rowSums(direction^2)))
}

# A list: `grid`, the points, and `policy`, the networks at these points as candidates.
new_plane <- function(policy, directions, size, span) {
  steps <- span * seq(-1, 1, length.out = size)
  # The middle is exactly the best policy, without a rounding error.
  steps[(size + 1) / 2] <- 0
  grid <- expand.grid(a = steps, b = steps, KEEP.OUT.ATTRS = FALSE)
  move <- function(a, b) {
    policy$weights <- Map(
      function(layer, first, second) layer + a * first + b * second,
      policy$weights, directions[[1L]], directions[[2L]]
    )
    weight_vector(policy)
  }
  weights <- do.call(rbind, Map(move, grid$a, grid$b))
  list(grid = grid, policy = new_candidates(policy, weights), directions = directions)
}

# Playing it ----------------------------------------------------------------------

#' Play the episodes of all points in parallel
#' @return As [search_landscape()].
#' @noRd
play_plane <- function(vector_env, plane, search, episodes, streams, progress) {
  started <- proc.time()[["elapsed"]]
  points <- nrow(plane$grid)
  show <- progress_bar(points, "Network", shown = progress)
  history <- new_history(points, episodes, streams, common_seeds = TRUE)
  finished <- function() history$played_episodes %/% episodes
  interrupted <- until_interrupted(
    play_batches(
      vector_env, history, function(candidates) policy_subset(plane$policy, candidates),
      report = function(ended) show((history$played_episodes + ended) %/% episodes),
      max_steps = search$max_steps %||% Inf
    ),
    "Interrupted after {finished} of {total} network{?s}; the rest of the landscape is empty.",
    finished, points
  )
  returns <- episode_results(history)$returns
  whole <- seq_len(finished())
  plane$grid$mean_return <- NA_real_
  plane$grid$mean_return[whole] <- colMeans(
    matrix(returns[seq_len(length(whole) * episodes)], episodes)
  )
  structure(
    list(
      grid = plane$grid, best = plane$grid$mean_return[[(points + 1L) / 2L]],
      directions = plane$directions, policy = search$policy, env_id = search$env_id,
      wrappers = wrappers_around(search),
      target = search$target, episodes = episodes,
      seeds = unique(unlist(lapply(history$batches, function(batch) batch$seed))),
      common = has_common_seeds(vector_env),
      elapsed = proc.time()[["elapsed"]] - started, interrupted = interrupted
    ),
    class = "gym_landscape"
  )
}

# Printing -------------------------------------------------------------------------

#' @export
as.data.frame.gym_landscape <- function(x, row.names = NULL, optional = FALSE, ...) x$grid

#' @export
print.gym_landscape <- function(x, ...) {
  played <- x$grid$mean_return[!is.na(x$grid$mean_return)]
  n <- sqrt(nrow(x$grid))
  cat(
    paste0("Landscape around the best policy found in ", env_text(x), ": ", n, " x ", n,
           " networks, ", count_of(x$episodes, "episode"), " each",
           if (x$common) ", the same for all"),
    landscape_returns_line(x, played),
    if (length(played) && is.numeric(x$target) && is.finite(x$target)) {
      paste0("Networks that reach the target of ", number_text(x$target), ": ",
             percent_text(mean(played >= x$target)))
    },
    if (x$interrupted) {
      paste0("Interrupted", elapsed_text(x$elapsed, " after "))
    } else {
      elapsed_text(x$elapsed, "Played in ")
    },
    sep = "\n"
  )
  invisible(x)
}

landscape_returns_line <- function(x, played) {
  if (length(played)) {
    paste0("Mean return: ", if (!is.na(x$best)) paste0("best policy ", number_text(x$best), ", "),
           "all from ", number_text(min(played)), " to ", number_text(max(played)))
  }
}
