# Search with continuous actions: Pendulum takes a torque between -2 and 2. It has no reward
# threshold, so the search plays all rounds and keeps the best one.

library(gym)

set.seed(1)
result <- search_random(
  "Pendulum-v1",
  policy = policy_network(c(3, 4, 1), activation = c("tanh", "tanh")),
  rounds = 10
)
result
plot(result)
