# Solve CartPole: search for a network that balances the pole, look at it, and play an episode.

library(gym)

set.seed(1)
result <- search_random("CartPole-v0")
result
plot(result)

# Is it as good as its five episodes in the search?
summary(result)

# Play one episode of this policy, step by step.
d <- as.data.frame(rollout("CartPole-v0", result$policy, steps = TRUE))
head(d)
plot(d$step, d$pole_angle, type = "l", xlab = "step", ylab = "pole angle (rad)")
