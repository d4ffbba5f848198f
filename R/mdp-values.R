# Values of a given policy, and best ones: within a number of steps, and without a limit.

# When sweeps end: the values are off by less than this, relative to the largest of them, as far as
# the discount tells.
sweep_tolerance <- 1e-13
most_sweeps <- 1e5

# Within a number of steps ------------------------------------------------------------

#' Values with some steps to go
#'
#' @param values_of A function of action values that returns those of the states.
#' @param see A function that is called with the values after each sweep.
#' @return The values of states when all steps are to go.
#' @noRd
horizon_values <- function(backup, horizon, discount, values_of, see = function(values, q) NULL) {
  values <- numeric(backup$states)
  for (sweep in seq_len(horizon)) {
    q <- action_values(backup, values, discount)
    values <- values_of(q)
    see(values, q)
  }
  values
}

# Without a limit ---------------------------------------------------------------------

#' The values of a policy
#'
#' Solves the policy's linear equations. With a discount of 1 only the states from which episodes
#' end have equations: those from which the policy never ends have 0 where no reward comes any more,
#' an infinite value where rewards of one sign come for ever, and otherwise `NaN`.
#' @noRd
policy_values <- function(backup, probabilities, discount) {
  chain <- chain_of(backup, probabilities)
  weight <- discount * chain$weight
  solved <- function(which) {
    solve(diag(sum(which)) - weight[which, which, drop = FALSE], chain$reward[which])
  }
  if (discount < 1) {
    return(solved(rep(TRUE, backup$states)))
  }
  leads <- function(reached) drop(weight %*% reached) > 0
  resting <- never_rewarded(chain)
  good <- closure(leads, chain$ends | resting)
  values <- numeric(backup$states)
  equations <- good & !resting
  if (any(equations)) {
    # From a state with an equation states that never end can be reached, too.
    lost <- equations & closure(leads, !good)
    values[equations & !lost] <- solved(equations & !lost)
    endless <- lost | !good
    values[endless] <- endless_values(weight, chain$reward, endless, good)
  } else {
    values[!good] <- endless_values(weight, chain$reward, !good, good)
  }
  values
}

# The states that no reward follows on, and no end.
never_rewarded <- function(chain) {
  resting <- chain$reward == 0 & !chain$ends
  repeat {
    stays <- resting & drop(chain$weight %*% !resting) == 0
    if (identical(stays, resting)) {
      return(resting)
    }
    resting <- stays
  }
}

endless_values <- function(weight, reward, endless, good) {
  vapply(which(endless), function(state) {
    after <- seq_along(reward) == state
    after <- closure(function(reached) drop(reached %*% weight) > 0, after)
    signs <- unique(sign(reward[after & !good]))
    signs <- signs[signs != 0]
    if (length(signs) == 1L) signs * Inf else NaN
  }, 0)
}

#' Best values by value iteration
#'
#' @param see As for [horizon_values()].
#' @return A list: `values` and `sweeps`.
#' @noRd
iterate_values <- function(backup, discount, see, call) {
  values <- numeric(backup$states)
  for (sweep in seq_len(most_sweeps)) {
    q <- action_values(backup, values, discount)
    new <- best_values(q)
    see(new, q)
    change <- max(abs(new - values))
    values <- new
    if (change <= sweep_tolerance * max(1 - discount, 0.01) * max(1, abs(values))) {
      return(list(values = values, sweeps = sweep))
    }
  }
  abort_endless(backup, values, call)
}

abort_endless <- function(backup, values, call) {
  gym_abort(
    c(paste0("The values do not settle within ", format(most_sweeps, scientific = FALSE),
             " sweeps: with a discount of 1 there are states from which episodes never end and ",
             "rewards go on."),
      i = "Give a `discount` below 1, or a `horizon`."),
    class = "gym_error_argument", argument = "discount", call = call
  )
}

#' Best values by policy iteration
#'
#' Begins with a policy by which episodes end, where there is one, and changes an action only where
#' another is better by more than rounding.
#' @return As [iterate_values()].
#' @noRd
iterate_policies <- function(backup, discount, see, call) {
  choice <- ending_choice(backup, array(backup$possible, c(backup$states, backup$actions)))
  for (sweep in seq_len(1000L)) {
    values <- policy_values(backup, choice_probabilities(backup, choice), discount)
    if (!all(is.finite(values))) {
      abort_endless(backup, values, call)
    }
    q <- action_values(backup, values, discount)
    see(values, q)
    own <- q[cbind(seq_along(choice), choice)]
    best <- best_values(q)
    better <- best > own + 1e-9 * pmax(1, abs(best)) & rowSums(q > -Inf) > 0
    if (!any(better)) {
      return(list(values = values, sweeps = sweep))
    }
    choice[better] <- max.col(q, "first")[better]
  }
  abort_endless(backup, values, call)
}

choice_probabilities <- function(backup, choice) {
  probabilities <- matrix(0, backup$states, backup$actions)
  probabilities[cbind(seq_along(choice), choice)] <- 1
  probabilities[!backup$possible] <- 0
  probabilities
}

# Choosing among equals ---------------------------------------------------------------

#' Choose an action in each state so that episodes end, and soon
#'
#' Where several actions have the same value, some of them may lead in a circle for ever. Of the
#' actions that are allowed it takes those that bring the end in the fewest steps on average, found
#' by value iteration with a cost of 1 for each step.
#' @param allowed A logical matrix with a row for each state and a column for each action.
#' @return The number of an action for each state, from 1.
#' @noRd
ending_choice <- function(backup, allowed) {
  ending <- surely_ending(backup, allowed)
  steps <- backup
  steps$expected <- rep(-1, length(backup$expected))
  steps$possible <- as.vector(ending$allowed)
  values <- numeric(backup$states)
  for (sweep in seq_len(most_sweeps)) {
    q <- action_values(steps, values, 1)
    new <- best_values(q)
    if (max(abs(new - values)) <= 1e-9 * max(1, abs(new))) break
    values <- new
  }
  # Where nothing ends the first of the allowed ones.
  q[!ending$states, ] <- ifelse(allowed[!ending$states, ], 0, -Inf)
  # Differences that are only rounding must not decide.
  max.col(round(q, 6), "first")
}

#' The states from which the allowed actions can be so chosen that every episode ends
#'
#' @return A list: `states`, a logical vector, and `allowed`, the actions that lead to no other
#'   states, a logical matrix.
#' @noRd
surely_ending <- function(backup, allowed) {
  shape <- c(backup$states, backup$actions)
  goes_on <- backup$weight > 0
  ends <- backup$probability > 0 & backup$weight == 0
  any_of <- function(x) array(rowSums(x) > 0, shape)
  can_end <- any_of(ends)
  states <- rep(TRUE, backup$states)
  repeat {
    leaves <- any_of(goes_on & !states[backup$next_state])
    safe <- allowed & !leaves
    leads <- function(reached) {
      rowSums(safe & any_of(goes_on & reached[backup$next_state])) > 0
    }
    reached <- closure(leads, rowSums(safe & can_end) > 0)
    if (identical(reached & states, states)) {
      return(list(states = states, allowed = safe & states))
    }
    states <- reached & states
  }
}
