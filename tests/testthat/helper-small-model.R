# A model with three states and two actions, whose values solve_mdp() knows; a policy that acted in
# it, and one to evaluate.
small_model <- function() {
  gym_model(data.frame(
    state = c(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2), action = c(0, 0, 1, 1),
    next_state = c(0, 1, 1, 2, 0, 2, 2, 3, 1, 0, 2, 3),
    probability = c(0.7, 0.3, 0.6, 0.4, 0.5, 0.5, 0.8, 0.2, 0.9, 0.1, 0.5, 0.5),
    reward = c(0, 1, -1, 2, 0, 1, 1, 3, 0, -1, 2, 5)
  ), start = c(`0` = 0.5, `1` = 0.3, `2` = 0.2))
}
behaves <- rbind(c(0.5, 0.5), c(0.4, 0.6), c(0.6, 0.4), c(0.5, 0.5))
wanted <- rbind(c(0.3, 0.7), c(0.6, 0.4), c(0.4, 0.6), c(1, 0))
by_table <- function(p) function(states) p[states[[1L]] + 1, ]
