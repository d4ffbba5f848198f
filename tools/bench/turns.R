# How every contender in R is timed, in the bench's own process and in its workers: a turn
# plays CartPole with alternating actions for some seconds and gives env steps a second.

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

# `step(actions)` moves all lanes, which begin their next episodes by themselves; `actions`
# are two batches made beforehand.
play_lanes <- function(lanes, actions, step, seconds) {
  steps <- 0
  started <- now()
  repeat {
    for (i in rep_len(1:2, 10L)) step(actions[[i]])
    steps <- steps + 10 * lanes
    elapsed <- now() - started
    if (elapsed >= seconds) {
      return(steps / elapsed)
    }
  }
}

alternating <- function(lanes) list(rep_len(0:1, lanes), rep_len(1:0, lanes))
