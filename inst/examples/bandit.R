# The ten-armed testbed of Sutton and Barto (2018), chapter 2: does exploring pay?
#
# A bandit has ten arms. Each arm has its own mean reward, which the player does not know. A
# player who always pulls the best arm so far may never find a better one. The functions are
# vectorised: each line below works on 500 bandits at once.

library(gym)

bandit <- gym_env(
  reset = function(self) {
    self$means <- matrix(rnorm(self$num_envs * self$arms), ncol = self$arms)
    # There is nothing to see.
    integer(self$num_envs)
  },
  step = function(self, action) {
    mean <- self$means[cbind(seq_len(self$num_envs), action + 1)]
    list(
      observation = integer(self$num_envs), reward = rnorm(self$num_envs, mean),
      terminated = logical(self$num_envs), info = list(best = max.col(self$means) == action + 1)
    )
  },
  observation_space = space_discrete(1), action_space = space_discrete(10),
  vectorized = TRUE, num_envs = 500, arms = 10, id = "Bandit", max_episode_steps = 1000
)

# Pulls the best arm so far, and with probability `epsilon` any arm.
play <- function(epsilon) {
  n <- bandit$num_envs
  estimates <- matrix(0, n, 10)
  pulls <- matrix(0, n, 10)
  rewards <- best <- numeric(1000)
  bandit$reset(seed = 1)
  for (step in 1:1000) {
    # Draw among the arms with the same estimate.
    arm <- max.col(estimates, ties.method = "random")
    explores <- runif(n) < epsilon
    arm[explores] <- sample.int(10, sum(explores), replace = TRUE)
    out <- bandit$step(arm - 1)
    pulled <- cbind(seq_len(n), arm)
    pulls[pulled] <- pulls[pulled] + 1
    estimates[pulled] <- estimates[pulled] + (out$reward - estimates[pulled]) / pulls[pulled]
    rewards[step] <- mean(out$reward)
    best[step] <- mean(out$info$best)
  }
  list(rewards = rewards, best = best)
}

set.seed(1)
epsilons <- c(0, 0.01, 0.1)
played <- lapply(epsilons, play)

last <- 901:1000
print(data.frame(
  epsilon = epsilons,
  reward = sapply(played, function(run) round(mean(run$rewards[last]), 2)),
  best_arm = sapply(played, function(run) round(mean(run$best[last]), 2))
))

# Figure 2.2 of the book.
matplot(
  sapply(played, function(run) run$rewards), type = "l", lty = 1, xlab = "Step",
  ylab = "Mean reward", main = "Ten-armed testbed"
)
legend("bottomright", paste("epsilon =", epsilons), col = 1:3, lty = 1, bty = "n")
