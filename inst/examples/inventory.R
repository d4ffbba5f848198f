# A shop that never closes: how much to order each evening?
#
# The store holds 20 pieces at most. A day brings a Poisson number of buyers, 4 on average; a piece
# sells for 5 and costs 2, an order costs 4 beside the pieces, and every piece that stays overnight
# costs 0.1. No episode ever ends, so `max_steps` says how many days are played.

library(gym)

shop <- gym_env(
  reset = function(self) {
    self$stock <- rep(10, self$num_envs)
    self$stock
  },
  step = function(self, action) {
    # What the store cannot hold is not ordered.
    ordered <- pmin(action, 20 - self$stock)
    sold <- pmin(self$stock + ordered, rpois(self$num_envs, 4))
    self$stock <- self$stock + ordered - sold
    list(
      observation = self$stock,
      reward = 5 * sold - 2 * ordered - 4 * (ordered > 0) - 0.1 * self$stock,
      terminated = logical(self$num_envs)
    )
  },
  # 0 to 20 pieces in store; 0 to 20 pieces to order. All shops are played at once.
  observation_space = space_discrete(21), action_space = space_discrete(21), vectorized = TRUE,
  id = "Inventory"
)

print(check_env(shop, max_steps = 200))

# Theory says that a good rule has two numbers: with `low` pieces or fewer, order up to `high`.
rule <- function(low, high) {
  function(observation) ifelse(observation <= low, high - observation, 0)
}

profit <- function(low, high) {
  year <- rollout(shop, rule(low, high), episodes = 50, max_steps = 365, seed = 1)
  mean(year$episodes$return) / 365
}

rules <- expand.grid(low = c(0, 2, 4, 6), high = c(8, 12, 16, 20))
rules$profit <- round(mapply(profit, rules$low, rules$high), 2)
print(rules[order(-rules$profit), ], row.names = FALSE)

chance <- rollout(shop, policy_random(), episodes = 50, max_steps = 365, seed = 1)
cat("A day's profit by the best rule: ", max(rules$profit), ", by chance: ",
    round(mean(chance$episodes$return) / 365, 2), "\n", sep = "")
