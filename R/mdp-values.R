# Values of a given policy, and optimal values, without a limit of steps.

# Value iteration ends when no state's value changes by more than this, relative to its size and
# taking the discount into account. After too many sweeps, policy iteration continues instead.
sweep_tolerance <- 1e-13
most_sweeps <- 20000L

# Actions are equal if their values differ by less than this, relative to their size. Policy
# iteration also takes smaller gains, down to rounding errors, because a gain that occurs often adds
# up.
tie_tolerance <- 1e-12
least_gain <- 1e-14

# Of a policy, without a limit -----------------------------------------------------------

#' Compute the values of a policy
#'
#' Solves the policy's linear equations. With a discount of 1, only states from which episodes end
#' have equations. A state from which episodes never end has the value 0 if no more rewards come, an
#' infinite value if rewards of one sign go on forever, and otherwise `NaN`.
#' @return A list: `values`; and `sizes`, the values if each reward were replaced by its absolute
#'   value. A difference that is tiny compared with `sizes` is a rounding error.
#' @noRd
policy_values <- function(backup, probabilities, discount, call) {
  chain <- chain_of(backup, probabilities)
  weight <- discount * chain$weight
  values <- sizes <- numeric(backup$states)
  equations <- rep(TRUE, backup$states)
  if (discount == 1) {
    leads <- function(reached) times(weight, reached) > 0
    # From these states no reward and no end can be reached.
    resting <- !closure(leads, chain$reward != 0 | chain$ends)
    good <- closure(leads, chain$ends | resting)
    # A state that can reach the end may also reach a state from which episodes never end.
    endless <- if (all(good)) !good else closure(leads, !good)
    equations <- good & !resting & !endless
    values[endless] <- endless_values(chain, leads, !good)[endless]
    sizes[endless] <- Inf
  }
  if (any(equations)) {
    reward <- chain$reward[equations]
    if (!all(equations)) weight <- weight[equations, equations, drop = FALSE]
    worth <- chain_solver(weight, call)
    gains <- worth(pmax(reward, 0))
    losses <- worth(pmax(-reward, 0))
    values[equations] <- gains - losses
    sizes[equations] <- gains + losses
  }
  list(values = values, sizes = sizes)
}

# Rewards that go on forever are those of states that the policy always returns to.
endless_values <- function(chain, leads, never_ends) {
  returns <- returning_states(chain, never_ends)
  gains <- closure(leads, returns & chain$reward > 0)
  losses <- closure(leads, returns & chain$reward < 0)
  ifelse(gains & losses, NaN, ifelse(gains, Inf, -Inf))
}

#' Find the states that a policy always returns to
#'
#' Such states form classes that nothing leaves and in which every state reaches all others. So all
#' states of a class have the same lowest number among the states that they reach. The state with
#' this number represents the class: it reaches only states that lead back to it.
#' @param among A logical vector of states, which reach only such states.
#' @noRd
returning_states <- function(chain, among) {
  inside <- among[chain$from]
  from <- chain$from[inside]
  to <- chain$to[inside]
  # If several values are assigned to a state, R keeps the last one, which here is the lowest.
  lowest <- function(labels) {
    repeat {
      sorted <- order(labels[to], decreasing = TRUE, method = "radix")
      new <- labels
      new[from[sorted]] <- labels[to[sorted]]
      new <- pmin(labels, new)
      if (identical(new, labels)) {
        return(labels)
      }
      labels <- new
    }
  }
  number <- seq_along(among)
  label <- lowest(number)
  highest <- -lowest(-label)
  closure(
    function(reached) number %in% to[reached[from]], among & label == number & highest == number
  )
}

# The best values, without a limit --------------------------------------------------------------

#' Find the best values
#'
#' Without a discount two kinds of states are special. Some can rest, which means that they can go
#' on forever without a reward. This has the value 0, so these states get one more action, the last
#' one, which ends the episode with the reward 0. From others no policy is sure to end or to rest.
#' These have the value `-Inf`, and the best policy takes no action that may lead there.
#' @return A list: `values`, `choice` (the number of an action for each state, from 1) and `sweeps`.
#' @noRd
best_endless_values <- function(backup, discount, method, see, call) {
  task <- if (discount < 1) list(backup = backup) else with_rest(backup)
  if (any(task$hopeless)) {
    check_hopeless(backup, task$hopeless, call)
  }
  swept <- if (method == "value_iteration") iterate_values(task$backup, discount, see)
  choice <- starting_choice(task$backup, swept$tied, discount)
  found <- iterate_policies(
    task$backup, choice, discount, call, if (is.null(swept)) see else function(values) NULL
  )
  choice <- soonest_choice(task$backup, found, discount, call)
  values <- found$values
  values[task$hopeless] <- -Inf
  list(
    values = values, sweeps = swept$sweeps %||% found$sweeps,
    choice = if (discount < 1) choice else without_rest(choice, backup, task)
  )
}

iterate_values <- function(backup, discount, see) {
  values <- sizes <- numeric(backup$states)
  enough <- sweep_tolerance * max(1 - discount, 0.01)
  for (sweep in seq_len(most_sweeps)) {
    q <- action_values(backup, values, discount)
    new <- best_values(q)
    see(new)
    change <- abs(new - values)
    values <- new
    # A value that has shrunk to 0 is only as accurate as the larger values before it.
    sizes <- pmax(sizes, abs(values))
    if (all(change <= enough * sizes)) break
  }
  list(tied = tied_actions(action_values(backup, values, discount), sizes), sweeps = sweep)
}

# The first policy of policy iteration. Without a discount it must end episodes; it takes tied
# actions where these do.
starting_choice <- function(backup, tied, discount) {
  possible <- possible_of(backup)
  ending <- surely_ending(backup, tied %||% possible)
  if (discount == 1 && any(!ending$states & rowSums(possible) > 0)) {
    ending <- surely_ending(backup, possible)
  }
  ending$choice
}

#' Improve a policy until no action is better by more than rounding
#' @param see As for [solve_horizon()].
#' @param least The smallest improvement, relative to the size of the values.
#' @return A list: `values` and `sizes`, `choice`, `tied` (which actions are equally good), and
#'   `sweeps`.
#' @noRd
iterate_policies <- function(backup, choice, discount, call, see = function(values) NULL,
                             least = least_gain) {
  seen <- list()
  for (sweep in seq_len(1000L)) {
    found <- policy_values(backup, choice_probabilities(backup, choice), discount, call)
    values <- found$values
    if (!all(is.finite(values))) {
      if (least < tie_tolerance) { # It may be rounding that led into a circle.
        return(iterate_policies(backup, c(seen, list(choice))[[1L]], discount, call, see,
                                tie_tolerance))
      }
      abort_endless(which(!is.finite(values))[[1L]], call)
    }
    q <- action_values(backup, values, discount)
    see(values)
    own <- cbind(seq_along(choice), choice)
    better <- !tied_actions(q, found$sizes, least)[own] & q[own] > -Inf
    seen[[sweep]] <- choice
    choice[better] <- best_column(q)[better]
    # If a policy comes up again, it was better only by rounding.
    if (any(vapply(seen, identical, NA, choice))) {
      tied <- tied_actions(q, found$sizes)
      tied[own] <- q[own] > -Inf
      return(c(found, list(choice = seen[[sweep]], tied = tied, sweeps = sweep)))
    }
  }
  abort_endless(which.max(abs(values)), call)
}

# Actions with the same value as the best one of their state, up to rounding. `sizes` are the sizes
# of the numbers in the sum of each value.
tied_actions <- function(q, sizes, tolerance = tie_tolerance) {
  q >= row_max(q) - tolerance * pmax(abs(q), sizes) & q > -Inf
}

# The first valid action of each state. `actions` is a logical matrix.
first_of <- function(actions) best_column(actions + 0)

possible_of <- function(backup) array(backup$possible, c(backup$states, backup$actions))

choice_probabilities <- function(backup, choice) {
  probabilities <- one_hot(choice, backup$actions)
  probabilities[!backup$possible] <- 0
  probabilities
}

abort_endless <- function(state, call) {
  abort_wrong(
    "discount", NULL, call,
    "With a discount of 1 some values are infinite, as that of row {state} of the states: rewards
     go on there forever.",
    i = "Give a `discount` below 1, or a `horizon`."
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
  rested$ends <- c(backup$ends, rep(1, backup$states))
  rested$expected <- c(backup$expected, numeric(backup$states))
  rested$possible <- c(backup$possible, rest$states)
  ending <- surely_ending(rested, possible_of(rested))
  rested$possible <- as.vector(ending$allowed)
  rested <- with_flow(rested)
  leaves <- rowSums(possible_of(backup)) > 0
  list(backup = rested, stays = rest$actions, hopeless = !ending$states & leaves)
}

# The states that can rest (go on forever without a reward), and the actions that do it.
resting_actions <- function(backup) {
  shape <- c(backup$states, backup$actions)
  calm <- array(backup$possible & backup$expected == 0 & backup$ends == 0, shape)
  calm_beside <- function(leaves) {
    calm & !array(rowSums(backup$weight > 0 & leaves[backup$next_state]) > 0, shape)
  }
  leaves <- closure(function(leaves) rowSums(calm_beside(leaves)) == 0, logical(backup$states))
  list(states = !leaves, actions = calm_beside(leaves) & !leaves)
}

# Replaces the additional action, rest, by a real action that rests.
without_rest <- function(choice, backup, task) {
  rests <- choice > backup$actions
  choice[rests] <- first_of(task$stays)[rests]
  # From hopeless states all actions have the value -Inf, so take the first valid one.
  choice[task$hopeless] <- first_of(possible_of(backup))[task$hopeless]
  choice
}

# Without an end, positive rewards may add up to an infinite value.
check_hopeless <- function(backup, hopeless, call) {
  gains <- array(backup$expected > 0, c(backup$states, backup$actions)) & possible_of(backup)
  endless <- hopeless & rowSums(gains) > 0
  if (any(endless)) {
    abort_endless(which(endless)[[1L]], call)
  }
}

# Choosing among equals ---------------------------------------------------------------

# Chooses the tied actions that end episodes soonest, unless small losses of many steps add up.
soonest_choice <- function(backup, found, discount, call) {
  choice <- ending_choice(backup, found$tied, call)
  if (identical(choice, found$choice)) {
    return(choice)
  }
  values <- policy_values(backup, choice_probabilities(backup, choice), discount, call)$values
  if (all(values >= found$values - 10 * tie_tolerance * found$sizes)) choice else found$choice
}

#' Choose an action in each state so that episodes end, and soon
#'
#' If several actions have the same value, some may lead in a circle forever. This function takes
#' those allowed actions that reach the end in the fewest steps on average. It finds them by policy
#' iteration with a cost of 1 for each step.
#' @param allowed A logical matrix with a row for each state and a column for each action.
#' @return The number of an action for each state, from 1.
#' @noRd
ending_choice <- function(backup, allowed, call) {
  ending <- surely_ending(backup, allowed)
  if (!any(rowSums(ending$allowed) > 1)) {
    return(ending$choice)
  }
  steps <- backup
  steps$expected <- rep(-1, length(backup$expected))
  steps$possible <- as.vector(ending$allowed)
  found <- iterate_policies(steps, ending$choice, 1, call)
  # Rounding errors must not decide. But if there are very many steps, even one step more is as
  # small as a rounding error.
  soonest <- first_of(found$tied)
  chosen <- choice_probabilities(steps, soonest) > 0
  ends <- identical(surely_ending(backup, chosen)$states, ending$states)
  ifelse(ending$states, if (ends) soonest else found$choice, ending$choice)
}

#' Find the states from which allowed actions can make every episode end
#'
#' @return A list: `states`, a logical vector; `allowed`, the actions that lead to no other states,
#'   a logical matrix; and `choice`, an action for each state. It may lead nearer to the end, so
#'   every episode ends. If no episode ends from a state, it is the first allowed action.
#' @noRd
surely_ending <- function(backup, allowed) {
  shape <- c(backup$states, backup$actions)
  goes_on <- backup$weight > 0
  any_of <- function(x) array(rowSums(x) > 0, shape)
  can_end <- array(backup$ends > 0, shape)
  states <- rep(TRUE, backup$states)
  repeat {
    leaves <- any_of(goes_on & !states[backup$next_state])
    safe <- allowed & !leaves
    choice <- integer(backup$states)
    nearer <- safe & can_end
    repeat {
      more <- choice == 0L & rowSums(nearer) > 0
      if (!any(more)) break
      choice[more] <- first_of(nearer)[more]
      nearer <- safe & any_of(goes_on & (choice > 0L)[backup$next_state])
    }
    reached <- choice > 0L
    if (identical(reached & states, states)) {
      choice[!reached] <- first_of(allowed)[!reached]
      return(list(states = states, allowed = safe & states, choice = choice))
    }
    states <- reached & states
  }
}
