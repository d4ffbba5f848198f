# The candidates of a search: each is a set of weights that plays a number of episodes, whose mean
# return decides. (To the post's agent, search_random(), a candidate is a round.)

#' Make an empty history of candidates
#'
#' @param candidates How many candidates are to be played at most.
#' @param episodes How many episodes each of them plays.
#' @param on_finished A function that is called when candidates have finished, with how many have
#'   and the best of their mean returns.
#' @return A history, as [new_history()] returns it, with `target`, `on_finished`, `means` (the mean
#'   returns of the candidates that have finished), `unfinished` (the returns of the candidate that
#'   has begun and not finished, when its episodes are more than a batch has), `best` (of the best
#'   candidate so far `candidate`, `mean` and `weights`) and `weights` (of the candidates of the
#'   present batch, named by their numbers).
#' @noRd
new_candidate_history <- function(candidates, episodes, target, streams, on_finished,
                                  common_seeds = FALSE) {
  history <- new_history(candidates, episodes, streams, common_seeds)
  history$target <- target
  history$on_finished <- on_finished
  history$means <- numeric()
  history$unfinished <- numeric()
  history$best <- NULL
  history$weights <- list()
  history$ended <- FALSE
  history$keep <- function() NULL
  history
}

#' Enter the episodes of a batch into the history
#'
#' The candidates are judged in their order: the first whose mean return reaches the target ends the
#' search.
#' @return Whether the search has ended.
#' @noRd
enter_returns <- function(history, played) {
  returns <- c(history$unfinished, played$return)
  finished <- length(returns) %/% history$episodes
  of_finished <- seq_along(returns) <= finished * history$episodes
  history$unfinished <- returns[!of_finished]
  if (finished == 0) {
    return(FALSE)
  }
  means <- apply(matrix(returns[of_finished], ncol = finished), 2L, mean)
  before <- length(history$means)
  best <- which.max(means)
  if (is.null(history$best) || means[[best]] > history$best$mean) {
    number <- before + best
    history$best <- list(
      candidate = number, mean = means[[best]], weights = history$weights[[as.character(number)]]
    )
  }
  history$means <- c(history$means, means)
  history$on_finished(length(history$means), history$best$mean)
  any(vapply(means, reaches, NA, target = history$target))
}

reaches <- function(mean_return, target) !is.null(target) && isTRUE(mean_return >= target)

#' Draw the weights of the candidates of a batch
#'
#' A candidate that began in the batch before keeps its own.
#' @return The policy that plays the batch.
#' @noRd
draw_candidates <- function(history, template, candidates) {
  known <- history$weights[as.character(candidates)]
  history$weights <- lapply(seq_along(candidates), function(i) {
    known[[i]] %||% with_generator(
      history$streams$agent, weight_vector(policy_resample(template))
    )
  })
  names(history$weights) <- candidates
  all <- new_candidates(template, do.call(rbind, history$weights))
  policy_subset(all, seq_along(candidates))
}
