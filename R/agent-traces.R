# Learning from several steps at once, for one sub-environment after the other.

#' Learn by eligibility traces
#'
#' Replacing traces for tables and tiles, accumulating ones for a user's features (Sutton and Barto
#' 2018, sections 12.2 and 12.7).
#' @noRd
learn_by_traces <- function(agent, present, column, transitions, ahead) {
  rate <- scheduled(agent$learning_rate, agent$taken, "learning_rate") / (agent$basis$each %||% 1L)
  decay <- agent$discount * agent$lambda
  for (i in seq_along(column)) {
    place <- transitions$sub_env[[i]]
    own <- present[i, , drop = FALSE]
    value <- values_of(agent, own)[[column[[i]]]]
    error <- transitions$reward[[i]] + agent$discount * ahead[[i]] - value
    trace <- if (transitions$first[[i]] || length(agent$traces) < place) {
      array(0, dim(agent$weights))
    } else {
      decay * agent$traces[[place]]
    }
    if (is.null(agent$basis$each)) {
      trace[, column[[i]]] <- trace[, column[[i]]] + own[1L, ]
    } else {
      trace[own[1L, ] + nrow(trace) * (column[[i]] - 1L)] <- 1
    }
    agent$weights <- agent$weights + rate * error * trace
    agent$traces[[place]] <- trace
  }
  agent
}

#' Learn from what n steps came to (Sutton and Barto 2018, sections 7.1 and 7.2)
#' @noRd
learn_by_steps <- function(agent, present, column, transitions, ahead) {
  rate <- scheduled(agent$learning_rate, agent$taken, "learning_rate")
  ended <- transitions$terminated | transitions$truncated
  for (i in seq_along(column)) {
    place <- transitions$sub_env[[i]]
    steps <- if (!transitions$first[[i]] && length(agent$pending) >= place) agent$pending[[place]]
    steps <- c(steps, list(list(
      present = present[i, , drop = FALSE], column = column[[i]], reward = transitions$reward[[i]]
    )))
    # At the end of an episode all that are left have come to something.
    while (length(steps) && (length(steps) == agent$n || ended[[i]])) {
      rewards <- vapply(steps, function(step) step$reward, 0)
      powers <- agent$discount^(seq_along(rewards) - 1L)
      target <- sum(powers * rewards) + agent$discount^length(rewards) * ahead[[i]]
      first <- steps[[1L]]
      error <- target - values_of(agent, first$present)[[first$column]]
      agent$weights <- move_weights(
        agent$basis, agent$weights, first$present, first$column, rate, error
      )
      steps <- steps[-1L]
      if (!ended[[i]]) break
    }
    agent$pending[place] <- list(steps)
  }
  agent
}
