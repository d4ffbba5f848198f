# Models that tests solve and play.

# From state 1 to the left lies 0, an end, to the right 2, and further 3, an end worth 1.
walk_table <- function() {
  data.frame(
    state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
    reward = c(0, 0, 0, 1)
  )
}

walk_model <- function(...) gym_model(walk_table(), start = 1, ...)

# One action goes on, with reward, the other ends.
endless_model <- function(reward = -1) {
  gym_model(data.frame(
    state = c(0, 0), action = c(0, 1), next_state = c(0, 1), reward = c(reward, 5)
  ), start = 0)
}
