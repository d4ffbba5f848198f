# Values of a given policy, and best ones: within a number of steps, and without a limit.

# When sweeps end: the values are off by less than this, relative to the largest of them, as far as
# the discount tells. Where they take longer than this, policy iteration goes on.
sweep_tolerance <- 1e-13
most_sweeps <- 20000L

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

# Of a policy, without a limit -----------------------------------------------------------

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
  # Also from a state that can come to the end one that never does may be reached.
  endless <- if (all(good)) !good else closure(leads, !good)
  values <- numeric(backup$states)
  equations <- good & !resting & !endless
  if (any(equations)) {
    values[equations] <- solved(equations)
  }
  if (any(endless)) {
    values[endless] <- endless_values(weight, chain$reward, endless, !good)
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

# What comes for ever are the rewards of the states that are always come back to: those that are
# reached again from wherever they lead.
endless_values <- function(weight, reward, endless, never_ends) {
  reach <- reachable(weight > 0)
  returns <- vapply(seq_along(reward), function(state) {
    never_ends[[state]] && all(reach[reach[state, ], state])
  }, NA)
  vapply(which(endless), function(state) {
    signs <- unique(sign(reward[reach[state, ] & returns]))
    signs <- signs[signs != 0]
    if (length(signs) == 1L) signs * Inf else NaN
  }, 0)
}

# Which states are reached from which, in at least one step, a logical matrix.
reachable <- function(leads) {
  repeat {
    further <- leads | (leads %*% leads) > 0
    if (identical(further, leads)) {
      return(leads)
    }
    leads <- further
  }
}

# The best, without a limit --------------------------------------------------------------

#' Find the best values
#'
#' Without a discount two kinds of states are special. Some can rest: stay for ever where no reward
#' comes, which is worth 0. They get one more action, the last one, that ends the episode for 0. And
#' from some no policy comes to an end or to rest for sure: these have the value `-Inf`, and no
#' action that may lead there is taken.
#' @return A list: `values`, `choice` (the number of an action for each state, from 1) and `sweeps`.
#' @noRd
best_endless_values <- function(backup, discount, method, see, call) {
  task <- if (discount < 1) list(backup = backup) else with_rest(backup)
  if (any(task$hopeless)) {
    check_hopeless(backup, task$hopeless, call)
  }
  sweeps <- 0L
  if (method == "value_iteration") {
    swept <- iterate_values(task$backup, discount, see)
    sweeps <- swept$sweeps
    choice <- ending_choice(task$backup, tied_actions(swept$q))
  } else {
    choice <- ending_choice(task$backup, possible_of(task$backup))
  }
  found <- iterate_policies(task$backup, choice, discount, if (sweeps) NULL else see, call)
  values <- found$values
  values[task$hopeless] <- -Inf
  list(
    values = values, sweeps = if (sweeps) sweeps else found$sweeps,
    choice = if (discount < 1) found$choice else without_rest(found$choice, backup, task)
  )
}

iterate_values <- function(backup, discount, see) {
  values <- numeric(backup$states)
  enough <- sweep_tolerance * max(1 - discount, 0.01)
  for (sweep in seq_len(most_sweeps)) {
    q <- action_values(backup, values, discount)
    new <- best_values(q)
    see(new, q)
    change <- max(abs(new - values))
    values <- new
    if (change <= enough * max(1, abs(values))) break
  }
  list(q = action_values(backup, values, discount), sweeps = sweep)
}

#' Improve a policy until no action is better by more than rounding
#' @param see `NULL`, or as for [horizon_values()].
#' @noRd
iterate_policies <- function(backup, choice, discount, see, call) {
  for (sweep in seq_len(1000L)) {
    values <- policy_values(backup, choice_probabilities(backup, choice), discount)
    if (!all(is.finite(values))) {
      abort_endless(which(!is.finite(values))[[1L]], call)
    }
    q <- action_values(backup, values, discount)
    if (!is.null(see)) see(values, q)
    own <- q[cbind(seq_along(choice), choice)]
    better <- own < best_values(q) - tie_tolerance(q) & own > -Inf
    if (!any(better)) {
      # Of equal actions those that end episodes soonest.
      choice <- ending_choice(backup, tied_actions(q))
      return(list(values = values, choice = choice, sweeps = sweep))
    }
    choice[better] <- best_column(q)[better]
  }
  abort_endless(which.max(abs(values)), call)
}

# Actions that are worth the same as the best one of their state, up to rounding.
tied_actions <- function(q) q >= row_max(q) - tie_tolerance(q) & q > -Inf

tie_tolerance <- function(q) 1e-9 * pmax(1, abs(best_values(q)))

possible_of <- function(backup) array(backup$possible, c(backup$states, backup$actions))

choice_probabilities <- function(backup, choice) {
  probabilities <- matrix(0, backup$states, backup$actions)
  probabilities[cbind(seq_along(choice), choice)] <- 1
  probabilities[!backup$possible] <- 0
  probabilities
}

abort_endless <- function(state, call) {
  gym_abort(
    c(paste0("With a discount of 1 some values are infinite, as that of row ", state, " of the ",
             "states: rewards go on there for ever."),
      i = "Give a `discount` below 1, or a `horizon`."),
    class = "gym_error_argument", argument = "discount", call = call
  )
}

# Rest, and no end ----------------------------------------------------------------------

with_rest <- function(backup) {
  rest <- resting_actions(backup)
  rested <- backup
  more <- function(matrix, value) rbind(matrix, matrix(value, backup$states, ncol(matrix)))
  rested$actions <- backup$actions + 1L
  rested$next_state <- more(backup$next_state, 1L)
  rested$weight <- more(backup$weight, 0)
  rested$terminated <- more(backup$terminated, TRUE)
  certain <- matrix(0, backup$states, ncol(backup$weight))
  certain[, 1L] <- 1
  rested$probability <- rbind(backup$probability, certain)
  rested$expected <- c(backup$expected, numeric(backup$states))
  rested$possible <- c(backup$possible, rest$states)
  ending <- surely_ending(rested, possible_of(rested))
  rested$possible <- as.vector(ending$allowed)
  leaves <- rowSums(possible_of(backup)) > 0
  list(backup = rested, stays = rest$actions, hopeless = !ending$states & leaves)
}

# The states that can stay for ever where no reward comes, and the actions by which they do.
resting_actions <- function(backup) {
  shape <- c(backup$states, backup$actions)
  ends <- rowSums(backup$probability * backup$terminated) > 0
  calm <- array(backup$possible & backup$expected == 0 & !ends, shape)
  states <- rep(TRUE, backup$states)
  repeat {
    leaves <- array(rowSums(backup$weight > 0 & !states[backup$next_state]) > 0, shape)
    actions <- calm & !leaves
    stay <- states & rowSums(actions) > 0
    if (identical(stay, states)) {
      return(list(states = states, actions = actions & states))
    }
    states <- stay
  }
}

# To rest is to take an action that stays where no reward comes.
without_rest <- function(choice, backup, task) {
  rests <- choice > backup$actions
  choice[rests] <- best_column(task$stays + 0)[rests]
  # Where nothing ends all actions are as good.
  choice[task$hopeless] <- best_column(possible_of(backup) + 0)[task$hopeless]
  choice
}

# Rewards above 0 that go on for ever are worth more than anything.
check_hopeless <- function(backup, hopeless, call) {
  gains <- array(backup$expected > 0, c(backup$states, backup$actions)) & possible_of(backup)
  endless <- hopeless & rowSums(gains) > 0
  if (any(endless)) {
    abort_endless(which(endless)[[1L]], call)
  }
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
