# CartPole written in R, by the equations in gymnasium/envs/classic_control/cartpole.py: one version
# for one pole, and one for many.

cartpole_space <- function() {
  space_box(
    low = c(cart_position = -4.8, cart_velocity = -Inf, pole_angle = -24 * pi / 180,
            pole_angular_velocity = -Inf),
    high = c(4.8, Inf, 24 * pi / 180, Inf), dtype = "float32"
  )
}

# `start` is a matrix of states with a row for each sub-environment, NULL for random ones.
r_cartpole <- function(max_episode_steps = 500L, start = NULL) {
  gym_env(
    reset = function(self) {
      self$state <- if (is.null(start)) runif(4, -0.05, 0.05) else start[1L, ]
      self$state
    },
    step = function(self, action) {
      state <- self$state
      force <- if (action == 1) 10 else -10
      cosine <- cos(state[[3L]])
      sine <- sin(state[[3L]])
      push <- (force + 0.05 * state[[4L]]^2 * sine) / 1.1
      angular <- (9.8 * sine - cosine * push) / (0.5 * (4 / 3 - 0.1 * cosine^2 / 1.1))
      linear <- push - 0.05 * angular * cosine / 1.1
      state <- state + 0.02 * c(state[[2L]], linear, state[[4L]], angular)
      self$state <- state
      list(
        observation = state, reward = 1,
        terminated = abs(state[[1L]]) > 2.4 || abs(state[[3L]]) > 12 * 2 * pi / 360
      )
    },
    observation_space = cartpole_space(), action_space = space_discrete(2),
    id = "CartPole-R", max_episode_steps = max_episode_steps, reward_threshold = 475,
    render_fps = 50
  )
}

r_cartpole_vectorized <- function(max_episode_steps = 500L, start = NULL, ...) {
  gym_env(
    reset = function(self) {
      n <- self$num_envs
      self$state <- if (is.null(start)) matrix(runif(4 * n, -0.05, 0.05), n) else start
      self$state
    },
    step = function(self, action) {
      state <- self$state
      force <- ifelse(action == 1, 10, -10)
      cosine <- cos(state[, 3L])
      sine <- sin(state[, 3L])
      push <- (force + 0.05 * state[, 4L]^2 * sine) / 1.1
      angular <- (9.8 * sine - cosine * push) / (0.5 * (4 / 3 - 0.1 * cosine^2 / 1.1))
      linear <- push - 0.05 * angular * cosine / 1.1
      state <- state + 0.02 * cbind(state[, 2L], linear, state[, 4L], angular)
      self$state <- state
      list(
        observation = state, reward = rep(1, self$num_envs),
        terminated = abs(state[, 1L]) > 2.4 | abs(state[, 3L]) > 12 * 2 * pi / 360
      )
    },
    observation_space = cartpole_space(), action_space = space_discrete(2), vectorized = TRUE,
    id = "CartPole-R", max_episode_steps = max_episode_steps, reward_threshold = 475, ...
  )
}
