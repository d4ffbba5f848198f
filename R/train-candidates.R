# The candidates of a search: each is a set of weights that plays a number of episodes, whose mean
# return decides. (To the post's agent, search_random(), a candidate is a round.)

#' Make an empty history of candidates
#'
#' Episodes of many candidates are played at once and end in any order. The candidates are judged
#' in their own order all the same: the first whose mean return reaches the target ends the search,
#' and nothing of the candidates after it counts.
#' @param candidates How many candidates are to be played at most.
#' @param episodes How many episodes each of them plays.
#' @param on_finished A function that is called when candidates have finished, with how many have,
#'   counted from the first, and the best of their mean returns.
#' @return A history, as [new_history()] returns it, with `episodes_each`, `target`, `on_finished`,
#'   `policies` (a list, for each candidate that has begun its policy), `returns` (of all episodes),
#'   `means` (the candidates' mean returns) and `unfinished` (how many episodes of each candidate
#'   that has begun have not ended).
#' @noRd
new_candidates <- function(candidates, episodes, target, on_finished) {
  history <- new_history(as.numeric(candidates) * episodes, end_candidate_episodes)
  history$episodes_each <- episodes
  history$target <- target
  history$on_finished <- on_finished
  history$policies <- list()
  history$returns <- numeric()
  history$means <- numeric()
  history$unfinished <- integer()
  history
}

#' Enter episodes that have ended into the history
#'
#' A candidate that reaches the target makes all later ones needless: they are not played on.
#' Candidates before it are, because one of them may reach the target, too.
#' @noRd
end_candidate_episodes <- function(history, episodes, returns) {
  history$returns[episodes] <- returns
  of_candidate <- candidate_of(history, episodes)
  candidates <- unique(of_candidate)
  left <- history$unfinished[candidates] - tabulate(match(of_candidate, candidates))
  finished <- candidates[left == 0L]
  # The means come first: if an interrupt comes in between, no candidate is finished without one.
  history$means[finished] <- vapply(finished, candidate_mean, 0, history = history)
  history$unfinished[candidates] <- left
  if (length(finished)) {
    reached <- finished[vapply(history$means[finished], reaches, NA, target = history$target)]
    history$wanted <- min(history$wanted, reached * history$episodes_each)
    report_finished(history)
  }
}

report_finished <- function(history) {
  finished <- count_finished(history)
  if (finished > 0) {
    history$on_finished(finished, max(-Inf, history$means[seq_len(finished)], na.rm = TRUE))
  }
}

candidate_of <- function(history, episodes) (episodes - 1L) %/% history$episodes_each + 1L

candidate_mean <- function(history, candidate) {
  each <- history$episodes_each
  mean(history$returns[(candidate - 1L) * each + seq_len(each)])
}

# How many candidates, from the first, have finished without a gap.
count_finished <- function(history) {
  open <- which(history$unfinished > 0L)
  finished <- if (length(open)) open[[1L]] - 1L else length(history$unfinished)
  min(finished, history$wanted %/% history$episodes_each)
}

reaches <- function(mean_return, target) !is.null(target) && isTRUE(mean_return >= target)

#' Draw the policies of the candidates that begin among some episodes
#' @return What plays these episodes, for [act_batch()].
#' @noRd
draw_policies <- function(history, template, episodes) {
  candidate <- candidate_of(history, episodes)
  for (new in setdiff(candidate, seq_along(history$policies))) {
    history$policies[[new]] <- policy_resample(template)
    history$unfinished[[new]] <- as.integer(history$episodes_each)
  }
  candidates_of(history$policies[unique(candidate)], match(candidate, unique(candidate)))
}
