# Environments that need no server, for tests of what is played and drawn. They have
# what rollout() asks of an environment, and remember what was done to them.

discrete_space <- function(n = 2L, start = 0L) {
  new_space(list(name = "Discrete", n = n, start = start, dtype = "int64"))
}

box_space <- function(low, high, shape = length(low), dtype = "float32") {
  new_space(list(
    name = "Box", shape = as.list(shape), dtype = dtype, low = as.list(low), high = as.list(high)
  ))
}

# `reward` and `ends` are functions of seed, step and action. Observations depend on
# seed and step alone.
fake_environment <- function(reward = function(seed, step, action) 1,
                             ends = function(seed, step, action) step == 3L,
                             observation_space = box_space(rep(-1, 4), rep(1, 4)),
                             action_space = discrete_space(2L),
                             reward_threshold = NULL, id = "Fake-v0") {
  env <- new.env()
  env$spec <- list(id = id, reward_threshold = reward_threshold, max_episode_steps = NULL)
  env$observation_space <- observation_space
  env$action_space <- action_space
  env$seeds <- integer()
  env$actions <- list()
  env$closed <- 0L
  observe <- function() {
    if (inherits(observation_space, "gym_space_discrete")) {
      return(as.integer(observation_space$start + (env$seed + env$at) %% observation_space$n))
    }
    values <- sin(env$seed %% 1000 + env$at + seq_len(prod(observation_space$shape)))
    if (length(observation_space$shape) > 1L) array(values, observation_space$shape) else values
  }
  env$reset <- function(seed = NULL, options = NULL) {
    env$seed <- seed
    env$seeds <- c(env$seeds, seed)
    env$at <- 0L
    observe()
  }
  env$step <- function(action) {
    env$at <- env$at + 1L
    env$actions <- c(env$actions, list(action))
    ended <- ends(env$seed, env$at, action)
    list(
      observation = observe(), reward = reward(env$seed, env$at, action), done = ended,
      info = list(), terminated = ended, truncated = FALSE
    )
  }
  env$close <- function() {
    env$closed <- env$closed + 1L
    invisible(env)
  }
  env
}

# Episodes of one step each, with these returns in the order in which they are played.
scripted_environment <- function(returns, ...) {
  at <- 0L
  fake_environment(
    reward = function(seed, step, action) {
      at <<- at + 1L
      returns[[at]]
    },
    ends = function(seed, step, action) TRUE,
    ...
  )
}

# For a reward by which weights and seeds make a difference.
first_action <- function(seed, step, action) if (step == 1L) 10 * action + seed %% 5 else 0

# For the argument `client`: forced only when something is about to be made.
no_client <- function() stop("something was about to be made")
