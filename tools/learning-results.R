# Computes what vignette("learning") shows and keeps it in vignettes/learning.rds, so that the
# vignette builds without a server: four agents with the network of the post, 20 seeds each.
#
#   tools/in-env Rscript --no-init-file tools/learning-results.R
#
# Takes some ten minutes.
library(gym)

budget <- 60000
agents <- list(
  random = agent_random(16),
  hill_climb = agent_hill_climb(noise = 0.1, candidates = 16),
  cem = agent_cem(population = 40, elite = 8),
  ars = agent_ars(directions = 8, top = 4, step_size = 0.1, noise = 0.1)
)

train <- function(agent) {
  train_agent(agent, "CartPole-v1", policy_network(c(NA, 2, 1)), total_steps = budget, seeds = 1:20,
              eval_every = 4)
}
trained <- lapply(agents, train)

# What the pictures and tables need of each training.
slim <- function(trainings) {
  trainings$trainings <- lapply(trainings$trainings, function(training) {
    training[c("agent", "env")] <- NULL
    training$agent <- trainings$agent
    training$history <- training$history[c("iteration", "steps", "min_return", "median_return",
                                           "mean_return", "max_return", "elapsed")]
    training
  })
  trainings
}

one <- trained$ars$trainings[["1"]]
results <- list(
  budget = budget, trained = lapply(trained, slim), one = one,
  one_lines = utils::capture.output(print(one)),
  one_summary = utils::capture.output(print(summary(one))),
  provenance = utils::capture.output(print(provenance(trained$ars)))
)
saveRDS(results, "vignettes/learning.rds", compress = "xz", version = 3)
cat(format(file.size("vignettes/learning.rds"), big.mark = ","), "bytes\n")
for (name in names(trained)) print(trained[[name]])
