# Models that tests solve and play.

# States 0 to 3 in a row. The walk ends in 0, or in 3 with a reward of 1.
walk_table <- function() {
  data.frame(
    state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
    reward = c(0, 0, 0, 1)
  )
}

walk_model <- function(...) gym_model(walk_table(), start = 1, ...)

# The first action goes on for ever, with `reward`. The second one ends the episode.
endless_model <- function(reward = -1) {
  gym_model(data.frame(
    state = c(0, 0), action = c(0, 1), next_state = c(0, 1), reward = c(reward, 5)
  ), start = 0)
}

# Each action leads to a few random states, at a random cost.
random_table <- function(states, actions, successors) {
  table <- expand.grid(
    way = seq_len(successors), action = seq_len(actions) - 1, state = seq_len(states) - 1
  )
  table$next_state <- sample(states, nrow(table), replace = TRUE) - 1
  table$probability <- 1 / successors
  table$reward <- -stats::runif(nrow(table))
  table[-1L]
}

# A gambler wins or loses 1 until nothing is left, or `goal`, which is worth 1.
ruin_model <- function(goal, win) {
  state <- rep(seq_len(goal - 1), each = 2)
  next_state <- state + c(-1, 1)
  gym_model(data.frame(
    state, action = 0, next_state, probability = c(1 - win, win), reward = +(next_state == goal)
  ), start = 1)
}
