# A model with three states and two actions, whose values solve_mdp() computes, a policy that acted
# in the model, and a policy to evaluate.
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

# Actions with two parts. The first is rewarded if it equals the state, the second if it equals
# twice the state.
spaces_of_parts <- list(
  space_multi_discrete(2:3), space_tuple(space_discrete(2), space_discrete(3)),
  space_dict(left = space_discrete(2), right = space_discrete(3))
)
env_of_parts <- function(action_space) {
  gym_env(
    reset = function(self) self$state <- sample(0:1, 1),
    step = function(self, action) {
      reward <- (action[[1]] == self$state) + (action[[2]] == 2 * self$state)
      self$state <- sample(0:1, 1)
      list(observation = self$state, reward = reward, terminated = FALSE)
    },
    observation_space = space_discrete(2), action_space = action_space, max_episode_steps = 4
  )
}
