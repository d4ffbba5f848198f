# Times every contender in R, in the benchmark's own process and in its workers. A turn plays
# CartPole with alternating actions for some seconds and returns steps a second.

now <- function() proc.time()[["elapsed"]]

# `step(action)` takes a step and says whether the episode has ended.
play_single <- function(reset, step, seconds) {
  reset()
  steps <- 0
  started <- now()
  repeat {
    for (action in rep_len(0:1, 10L)) {
      if (step(action)) reset()
    }
    steps <- steps + 10
    elapsed <- now() - started
    if (elapsed >= seconds) {
      return(steps / elapsed)
    }
  }
}

# `step(actions)` steps all sub-environments, which begin their next episodes by themselves.
# `actions` are two batches that were made before.
play_vector <- function(num_envs, actions, step, seconds) {
  steps <- 0
  started <- now()
  repeat {
    for (i in rep_len(1:2, 10L)) step(actions[[i]])
    steps <- steps + 10 * num_envs
    elapsed <- now() - started
    if (elapsed >= seconds) {
      return(steps / elapsed)
    }
  }
}

alternating <- function(num_envs) list(rep_len(0:1, num_envs), rep_len(1:0, num_envs))
