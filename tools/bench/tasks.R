# The environments that are played by their ids, and the policy in each. R and Python use the same
# numbers, which Python reads from files. The benchmark and its worker with reticulate source this
# file.

# The kinds of policies: `discrete` takes the action with the largest output, `box` stretches
# tanh() of each output to the action's bounds, `random` draws.
task <- function(env_id, kind, inputs = 0L, outputs = 0L, episodes = 512L, quick = 512L,
                 goal = NA, reticulate = FALSE, stack = FALSE) {
  list(
    env_id = env_id, kind = kind, inputs = inputs, outputs = outputs, episodes = episodes,
    quick = quick, goal = goal, reticulate = reticulate, stack = stack
  )
}

# `goal` is how many times as fast as Python's loop rollout() should be. Pong has fewer episodes
# than the others, because one takes most of a second in Python. A quick run plays fewer long
# episodes, and more short ones.
tasks <- list(
  task("LunarLander-v3", "discrete", 8L, 4L, quick = 128L, goal = 1.6, reticulate = TRUE),
  task("BipedalWalker-v3", "box", 24L, 4L, quick = 64L, goal = 1.6, reticulate = TRUE),
  task("HalfCheetah-v5", "box", 17L, 6L, episodes = 64L, quick = 16L, goal = 1.4,
       reticulate = TRUE),
  task("Acrobot-v1", "discrete", 6L, 3L, quick = 64L, goal = 1.6, reticulate = TRUE),
  task("ALE/Pong-v5", "discrete", 4L * 84L * 84L, 6L, episodes = 16L, quick = 4L, goal = 1.5,
       reticulate = TRUE, stack = TRUE),
  task("Pendulum-v1", "box", 3L, 1L, quick = 64L, goal = 1.4),
  task("MountainCar-v0", "discrete", 2L, 3L, quick = 64L, goal = 1.4),
  task("FrozenLake-v1", "random", episodes = 20000L, quick = 5000L, goal = 1.2),
  task("Taxi-v4", "random", quick = 128L, goal = 1.6),
  task("Blackjack-v1", "random", episodes = 20000L, quick = 5000L, goal = 1.3)
)
names(tasks) <- vapply(tasks, function(task) task$env_id, "")

# The numbers of a task's policy: a matrix with a row for each output, nothing for a random policy.
# A seed draws them, so that every process and every run has the same.
task_numbers <- function(task, seed = 1L) {
  set.seed(seed, "Mersenne-Twister", "Inversion", "Rejection")
  if (task$kind == "random") {
    return(0)
  }
  matrix(stats::runif(task$outputs * task$inputs, -1, 1), nrow = task$outputs)
}

# For Python: a file of doubles, row by row.
write_numbers <- function(numbers) {
  file <- tempfile("numbers-")
  writeBin(as.double(if (is.matrix(numbers)) t(numbers) else numbers), file, endian = "little")
  file
}

# The policy as a function of a batch of observations, for a worker without this package: matrices
# are multiplied with a row for each observation.
task_function <- function(task, numbers, low = NULL, high = NULL) {
  outputs <- function(observation) matrix(observation, dim(observation)[1L]) %*% t(numbers)
  switch(task$kind,
    discrete = function(observation) max.col(outputs(observation), "first") - 1L,
    box = function(observation) {
      scaled <- (tanh(outputs(observation)) + 1) / 2
      t(low + (high - low) * t(scaled))
    },
    stop("No policy of this kind is played with reticulate: ", task$kind)
  )
}
