# Measures from how many steps a second learn_q() learns in Taxi: through the server and in its
# model in R, each with one sub-environment and with 32. All take several turns. Prints the medians
# and their ratios to the first.
#
#   tools/in-env Rscript --no-init-file tools/learn-speed.R [runs=5]
suppressMessages(library(gym))
source("tools/processes.R")

model <- env_model("Taxi-v4")
learn <- function(env, episodes, ...) {
  learned <- learn_q(env, iterations = 1, episodes = episodes, learning_rate = 1, discount = 1,
                     target = Inf, seed = 1, progress = FALSE, ...)
  learned$steps / learned$elapsed
}
ways <- list(
  "server, 1 sub-environment" = function() learn("Taxi-v4", 100),
  "server, 32 sub-environments" = function() learn("Taxi-v4", 600, num_envs = 32, num_workers = 0),
  "model in R, 1 sub-environment" = function() learn(model, 100),
  "model in R, 32 sub-environments" = function() learn(model, 600, num_envs = 32)
)
runs <- as.integer(option("runs", "5"))
rates <- t(replicate(runs, vapply(ways, function(way) way(), 0)))
middle <- apply(rates, 2, stats::median)
print(data.frame(`steps a second` = round(middle), ratio = round(middle / middle[[1L]], 1),
                 check.names = FALSE))
