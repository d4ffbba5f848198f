# A shop that never closes: how much to order each evening?
#
# The store holds at most 20 pieces. Each day brings a Poisson number of buyers, 4 on average. A
# piece sells for 5 and costs 2. Each order costs another 4. Every piece that stays overnight costs
# 0.1. Episodes never end, so `max_steps` sets the number of days.

library(gym)

shop <- gym_env(
  reset = function(self) {
    self$stock <- rep(10, self$num_envs)
    self$stock
  },
  step = function(self, action) {
    # Order no more than the store can hold.
    ordered <- pmin(action, 20 - self$stock)
    sold <- pmin(self$stock + ordered, rpois(self$num_envs, 4))
    self$stock <- self$stock + ordered - sold
    list(
      observation = self$stock,
      reward = 5 * sold - 2 * ordered - 4 * (ordered > 0) - 0.1 * self$stock,
      terminated = logical(self$num_envs)
    )
  },
  # 0 to 20 pieces in store, 0 to 20 pieces to order. All shops play at once.
  observation_space = space_discrete(21), action_space = space_discrete(21), vectorized = TRUE,
  id = "Inventory"
)

print(check_env(shop, max_steps = 200))

# A good rule has two numbers: when `low` pieces or fewer are left, order up to `high`.
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
