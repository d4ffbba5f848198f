# Converts a model to matrices with a row for each pair of a state and an action. One vectorised
# step then processes all states.

#' Prepare a model for sweeps over all its states
#'
#' Row s + S * (a - 1) belongs to state s and action a, both counted from 1, of S states. The
#' columns are the transitions of this pair. A row with few transitions has empty columns at its
#' end.
#' @param call The user's call.
#' @return A list: `states` and `actions`, their numbers; `next_state` (from 1) and `weight`,
#'   matrices, where the weight is the probability that the episode goes on there; and for each row
#'   `ends`, the probability that the episode ends, `expected`, the expected reward, and `possible`,
#'   whether the action is valid.
#' @noRd
backup_of <- function(model, call) {
  table <- numbered_transitions(model)
  states <- length(model$start)
  actions <- as.integer(model$action_space$n)
  row <- table$pair
  place <- sequence(rle(row)$lengths)
  shape <- c(as.double(states) * actions, max(place))
  check_fits_memory(
    prod(shape), paste0("Solving ", model$spec$id, ", with ", count_of(states, "state"), ", ",
                        count_of(actions, "action"), " and up to ",
                        count_of(shape[[2L]], "transition"), " of each"), call
  )
  at <- cbind(row, place)
  filled <- function(values, empty = 0) {
    matrix <- array(empty, shape)
    matrix[at] <- values
    matrix
  }
  rewards <- filled(table$probability * table$reward)
  expected <- rowSums(rewards)
  # Rewards that cancel out leave only rounding errors.
  expected[abs(expected) <= 4 * .Machine$double.eps * rowSums(abs(rewards))] <- 0
  with_flow(list(
    states = states, actions = actions,
    next_state = filled(table$to, 1L), weight = filled(table$probability * !table$terminated),
    ends = rowSums(filled(table$probability * table$terminated)),
    expected = expected, possible = seq_len(shape[[1L]]) %in% row
  ))
}

# Up to this number of states, a full matrix has the moves. Loading the package Matrix would take
# longer than computing with the full matrix.
full_states <- 500L

# With many states, sweeps are faster with the weights in one sparse matrix.
with_flow <- function(backup) {
  if (backup$states > full_states) {
    used <- which(backup$weight > 0)
    rows <- nrow(backup$weight)
    backup$flow <- Matrix::sparseMatrix(
      i = (used - 1L) %% rows + 1L, j = backup$next_state[used], x = backup$weight[used],
      dims = c(rows, backup$states)
    )
  }
  backup
}

# The most numbers in a table: 0.8 GB, and several such tables are needed.
most_cells <- 1e8

check_fits_memory <- function(cells, what, call, arg = "model", hint = NULL) {
  abort_if(
    cells > most_cells, arg, cells, call,
    "{what} needs tables of {whole_number_text(cells)} numbers; at most
     {whole_number_text(most_cells)} are possible.",
    i = hint
  )
}

# Numbers of states, counted from 1.
state_rows <- function(model, state) as.integer(state - model$observation_space$start + 1L)
action_columns <- function(model, action) as.integer(action - model$action_space$start + 1L)

# The number of each pair of a state, given by its row, and an action.
pair_rows <- function(model, row, action) {
  row + length(model$start) * (action_columns(model, action) - 1L)
}

# The possible transitions, sorted by pair. The columns `pair`, `from` and `to` are numbers of pairs
# and states.
numbered_transitions <- function(model) {
  table <- model$transitions[model$transitions$probability > 0, ]
  table$from <- state_rows(model, table$state)
  table$to <- state_rows(model, table$next_state)
  table$pair <- pair_rows(model, table$from, table$action)
  table[order(table$pair, method = "radix"), ]
}

# The value of each action in each state, a matrix, given the value of each state (Bellman's
# equation). Invalid actions have -Inf.
action_values <- function(backup, values, discount) {
  if (is.null(backup$flow)) {
    ahead <- values[backup$next_state]
    # Infinity or NaN times the probability 0 would be NaN.
    if (!all(is.finite(values))) ahead[backup$weight == 0] <- 0
    ahead <- .rowSums(backup$weight * ahead, nrow(backup$weight), ncol(backup$weight))
  } else {
    ahead <- times(backup$flow, values)
  }
  q <- backup$expected + discount * ahead
  q[!backup$possible] <- -Inf
  dim(q) <- c(backup$states, backup$actions)
  q
}

# The value of each state by the best action; 0 for a state without actions.
best_values <- function(q) {
  best <- row_max(q)
  best[best == -Inf] <- 0
  best
}

# The value of each state under these action probabilities, a matrix like `q`.
mean_values <- function(q, probabilities) {
  q[probabilities == 0] <- 0
  .rowSums(q * probabilities, nrow(q), ncol(q))
}

#' Describe how a policy moves from state to state
#'
#' @param probabilities A matrix with a row for each state and a column for each action.
#' @return A list: `weight`, a matrix with the probability that state j follows state i, sparse if
#'   there are many states (what a row lacks to 1 is the probability that the episode ends); `from`
#'   and `to`, the states of each move; `reward`, the expected reward in each state; `ends`, the
#'   states in which the episode may end.
#' @noRd
chain_of <- function(backup, probabilities) {
  moves <- policy_moves(backup, probabilities)
  mean_of <- function(x) mean_values(array(x, dim(probabilities)), probabilities)
  list(
    weight = flow_matrix(moves$from, moves$to, moves$weight, backup$states),
    from = moves$from, to = moves$to,
    reward = mean_of(backup$expected), ends = mean_of(backup$ends) > 0 | rowSums(probabilities) == 0
  )
}

# The moves of a policy that do not end the episode, each with its probability as `weight`.
policy_moves <- function(backup, probabilities) {
  weight <- backup$weight * as.vector(probabilities)
  used <- which(weight > 0)
  list(
    from = (used - 1L) %% backup$states + 1L, to = backup$next_state[used], weight = weight[used]
  )
}

flow_matrix <- function(from, to, weight, states) {
  if (states > full_states) {
    return(Matrix::sparseMatrix(i = from, j = to, x = weight, dims = c(states, states)))
  }
  flow <- matrix(0, states, states)
  sums <- rowsum(weight, from + states * (to - 1L))
  flow[as.integer(rownames(sums))] <- sums
  flow
}

# A matrix, full or sparse, times a vector.
times <- function(matrix, vector) as.vector(matrix %*% as.double(vector))

#' Find the states from which some states are reached
#'
#' @param leads A function of a logical vector of states that returns those from which one of them
#'   is reached in one step.
#' @param reached The states to start with, a logical vector.
#' @noRd
closure <- function(leads, reached) {
  repeat {
    more <- reached | leads(reached)
    if (identical(more, reached)) {
      return(reached)
    }
    reached <- more
  }
}
