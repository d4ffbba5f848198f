# A vector environment: each call steps 1,000 carts, which follow their poles.

library(gym)

env <- gym_make("CartPole-v1", num_envs = 1000, seed = 1)
print(env)

observation <- env$reset()
alive <- rep(TRUE, 1000)
steps <- 0
while (any(alive)) {
  # Push to the side to which the pole leans. Each row of the matrix is a cart.
  out <- env$step(observation[, "pole_angle"] > 0)
  observation <- out$observation
  steps <- steps + sum(alive)
  # A sub-environment starts a new episode when one ends. Only the first one counts here.
  alive <- alive & !out$done
}
env$close()

cat("1,000 episodes of", steps / 1000, "steps on average\n")

# rollout() does the same and returns a table of the episodes.
follow_pole <- function(observation) observation[, "pole_angle"] > 0
played <- rollout("CartPole-v1", follow_pole, episodes = 1000)
print(summary(played))
