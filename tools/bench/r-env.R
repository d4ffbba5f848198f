# Environments written in R: steps a second of rollout(), without a server, in the tests' CartPole,
# by functions for one pole and by functions for all poles at once.

r_env_names <- c(
  scalar = "rollout(), an environment in R",
  vectorized = "rollout(), an environment in R, vectorised"
)

compare_r_envs <- function(turns) {
  progress("environments in R")
  source(file.path("tests", "testthat", "helper-cartpole.R"), local = TRUE)
  envs <- list(scalar = r_cartpole(), vectorized = r_cartpole_vectorized())
  episodes <- list(scalar = 64, vectorized = 1024)
  # Every episode has 500 steps.
  lean <- function(observation) observation[, 3] + 0.5 * observation[, 4] > 0
  play <- function(kind) {
    started <- now()
    played <- rollout(envs[[kind]], lean, episodes[[kind]], seed = 1)
    sum(played$episodes$length) / (now() - started)
  }
  do.call(rbind, lapply(seq_len(turns), function(turn) {
    do.call(rbind, lapply(names(envs), function(kind) {
      num_envs <- as_vector_env(envs[[kind]])$num_envs
      measured("r_env", num_envs, r_env_names[[kind]], "rollout(env, policy, episodes)", turn,
               play(kind), "steps/s")
    }))
  }))
}
