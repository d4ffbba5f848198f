# A batch of episodes is cut into slices: neighbouring sub-environments with all episodes that they
# play. Slices can be played apart: each worker is given some, and those that it has are played side
# by side in one vector environment.
#
# The rule: a batch has at most 16 slices, whose numbers of sub-environments differ by one at most;
# where the episodes of several candidates fit into a slice it has whole candidates, whose numbers
# differ by one at most. It looks at the batch alone, never at workers. Each slice draws from a
# stream of its own, and its moments are those of its own observations, so that it does not matter
# beside which others it is played.

slices_of_batch <- 16L

#' Cut a batch into slices
#'
#' @param episodes How many episodes the batch has.
#' @param each How many of them belong to a candidate.
#' @return The number of the slice of each sub-environment that plays, integers. Where one generator
#'   serves all sub-environments there is one slice.
#' @noRd
slice_sub_envs <- function(vector_env, episodes, each) {
  playing <- min(episodes, vector_env$num_envs)
  if (vector_env$one_seed || length(vector_env$remembers)) {
    return(rep(1L, playing))
  }
  together <- if (episodes <= playing && each <= playing / slices_of_batch) each else 1L
  units <- ceiling(playing / together)
  unit <- (seq_len(playing) - 1L) %/% as.integer(together)
  # Larger and smaller slices take turns, so that neighbouring ones have equally many together.
  as.integer((unit * min(units, slices_of_batch)) %/% units) + 1L
}

# The streams of a batch's slices: the first is that of the batch.
slice_streams <- function(stream, count) {
  streams <- list(stream)
  for (i in seq_len(count - 1L)) {
    streams[[i + 1L]] <- parallel::nextRNGSubStream(streams[[i]])
  }
  streams
}

#' Choose the actions of all slices
#'
#' A policy that draws is asked about each slice with the slice's own generator; any other about all
#' of them at once. Whether a policy draws shows when it does for the first time: then it is asked
#' again.
#' @param batch,playing As [play_batch()] has them.
#' @noRd
act_in_slices <- function(batch, playing) {
  rows <- playing$rows$sub_env
  vector_env <- batch$vector_env
  if (!batch$draws) {
    before <- globalenv()$.Random.seed
    action <- act_batch(playing$acting, playing$observation, length(rows), vector_env)
    if (length(batch$streams) == 1L || identical(globalenv()$.Random.seed, before)) {
      return(action)
    }
    batch$draws <- TRUE
  }
  rows_of_slices <- split(seq_along(rows), batch$slice[rows])
  actions <- Map(
    function(slice, own) act_in_slice(batch, playing, as.integer(slice), own),
    names(rows_of_slices), rows_of_slices
  )
  together <- bind_batches(vector_env$action_space, unname(actions))
  batch_rows(vector_env$action_space, together, order(unlist(rows_of_slices)))
}

act_in_slice <- function(batch, playing, slice, rows) {
  vector_env <- batch$vector_env
  observation <- batch_rows(vector_env$observation_space, playing$observation, rows)
  acting <- policy_rows(batch$policy, playing$candidate[rows])
  assign(".Random.seed", batch$streams[[slice]], envir = globalenv())
  action <- act_batch(acting, observation, length(rows), vector_env)
  batch$streams[[slice]] <- globalenv()$.Random.seed
  action
}

# Moments of the observations of each slice ------------------------------------------------

# `count` has an element, `mean` and `squares` a row for each slice.
no_slice_moments <- function(slices) list(count = numeric(slices), mean = NULL, squares = NULL)

# How many steps are noted before their observations are added to the moments: adding takes R as
# long for a few rows as for hundreds. The number depends on the size of an observation alone.
steps_together <- function(numbers) max(1L, min(64L, 8192L %/% numbers))

# Notes the observations that a step was taken from.
note_observations <- function(batch, playing) {
  values <- number_rows(playing$observation)
  noted <- list(values = values, slice = batch$slice[playing$rows$sub_env])
  batch$noted[[length(batch$noted) + 1L]] <- noted
  if (playing$taken %% steps_together(ncol(values)) == 0L) add_noted(batch)
}

add_noted <- function(batch) {
  if (length(batch$noted)) {
    values <- do.call(rbind, lapply(batch$noted, `[[`, "values"))
    slice <- unlist(lapply(batch$noted, `[[`, "slice"))
    batch$moments <- add_slice_moments(batch$moments, values, slice)
    batch$noted <- list()
  }
}

#' Add observations to the moments of their slices
#'
#' All slices at once: as [merge_moments()] does for one. The numbers of a slice are summed in their
#' order, whatever slices are beside it.
#' @param slice The slice of each row of `values`.
#' @noRd
add_slice_moments <- function(moments, values, slice) {
  at <- unique(slice)
  row <- match(slice, at)
  new <- tabulate(row, length(at))
  mean <- rowsum(values, row, reorder = FALSE) / new
  deviations <- values - mean[row, , drop = FALSE]
  squares <- rowsum(deviations * deviations, row, reorder = FALSE)
  if (is.null(moments$mean)) {
    moments$mean <- moments$squares <- matrix(0, length(moments$count), ncol(values))
  }
  before <- moments$count[at]
  count <- before + new
  apart <- mean - moments$mean[at, , drop = FALSE]
  moments$count[at] <- count
  moments$mean[at, ] <- moments$mean[at, , drop = FALSE] + apart * (new / count)
  moments$squares[at, ] <- moments$squares[at, , drop = FALSE] + squares +
    apart * apart * (before * (new / count))
  moments
}

# A list with the moments of each slice that has any.
split_slice_moments <- function(moments) {
  lapply(which(moments$count > 0), function(slice) {
    new_moments(moments$count[[slice]], moments$mean[slice, ], moments$squares[slice, ])
  })
}

# Slices by themselves ---------------------------------------------------------------------

#' Take neighbouring slices out of a batch
#'
#' @param batch As [next_batch()] returns it.
#' @param which The numbers of the slices.
#' @return A list: `at`, the places of their episodes in the batch, and what [play_batch()] takes:
#'   `episodes`, `each`, `streams`, `slice`.
#' @noRd
slices_of <- function(batch, which) {
  slice <- batch$slice
  at <- which(rep(slice %in% which, length.out = length(batch$episodes$episode)))
  list(
    at = at, episodes = lapply(batch$episodes, `[`, at), each = batch$each,
    streams = batch$streams[which], slice = slice[slice %in% which] - which[[1L]] + 1L
  )
}

# Divides the slices of a batch among some workers, as evenly as it goes.
share_slices <- function(count, workers) {
  split(seq_len(count), sort((seq_len(count) - 1L) %% min(count, workers)))
}

#' Put the parts of a batch together
#'
#' @param parts As [slices_of()] returns them.
#' @param played What [play_batch()] returned for each of them.
#' @param target The mean return of a candidate after which later ones are left out, or `NULL`.
#' @return As [play_batch()] returns it for all of them side by side.
#' @noRd
bind_parts <- function(batch, parts, played, target = NULL) {
  at <- unlist(lapply(parts, `[[`, "at"))
  columns <- setdiff(names(played[[1L]]), c("steps", "frames", "moments"))
  together <- lapply(stats::setNames(nm = columns), function(name) {
    unlist(lapply(played, `[[`, name))[order(at)]
  })
  together$sub_env <- (seq_along(at) - 1L) %% length(batch$slice) + 1L
  together <- without_needless(together, batch$each, target)
  steps <- Map(function(part, one) {
    lapply(one$steps, function(step) {
      step$at <- part$at[step$at]
      step
    })
  }, parts, played)
  c(together, list(
    steps = unlist(steps, recursive = FALSE), frames = list(),
    moments = unlist(lapply(played, `[[`, "moments"), recursive = FALSE)
  ))
}

# Candidates after one that has reached the target.
without_needless <- function(episodes, each, target) {
  if (is.null(target)) {
    return(episodes)
  }
  returns <- split(episodes$return, episodes$candidate)
  reached <- vapply(returns, function(own) length(own) == each && isTRUE(mean(own) >= target), NA)
  if (!any(reached)) {
    return(episodes)
  }
  first <- as.integer(names(returns))[which(reached)[[1L]]]
  lapply(episodes, `[`, episodes$candidate <= first)
}
