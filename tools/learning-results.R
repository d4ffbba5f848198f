# Computes the results of vignette("learning") and keeps them in vignettes/learning.rds, so that the
# vignette builds without a server: four agents with the network of the tutorial, and two that
# follow gradients with their own networks, 20 seeds each.
#
#   tools/in-env Rscript --no-init-file tools/learning-results.R
#
# Takes some twenty minutes. To train only some agents again, give their names after the script's.
library(gym)

budget <- 60000
agents <- list(
  random = agent_random(16),
  hill_climb = agent_hill_climb(noise = 0.1, candidates = 16),
  cem = agent_cem(population = 40, elite = 8),
  ars = agent_ars(directions = 8, top = 4, step_size = 0.1, noise = 0.1),
  reinforce = agent_reinforce(),
  ppo = agent_ppo(
    batch_steps = 1024, batch = 128, learning_rate = 1e-3, gamma = 0.98, lambda = 0.9
  )
)
wanted <- commandArgs(trailingOnly = TRUE)
if (!length(wanted)) wanted <- names(agents)

train <- function(name) {
  policy <- if (!name %in% c("reinforce", "ppo")) policy_network(c(NA, 2, 1))
  train_agent(agents[[name]], "CartPole-v1", policy, total_steps = budget, seeds = 1:20,
              eval_every = 4)
}
trained <- lapply(rlang::set_names(wanted), train)

# Keeps of each training what the pictures and tables need.
slim <- function(trainings) {
  trainings$trainings <- lapply(trainings$trainings, function(training) {
    training[c("agent", "env")] <- NULL
    # The weights of large networks are not shown.
    if (length(coef(training$policy)) > 1000) training$policy$weights <- NULL
    training$agent <- trainings$agent
    training$history <- training$history[c("iteration", "steps", "min_return", "median_return",
                                           "mean_return", "max_return", "elapsed")]
    training
  })
  trainings
}

file <- "vignettes/learning.rds"
results <- if (length(wanted) < length(agents)) readRDS(file) else list(budget = budget)
results$trained[wanted] <- lapply(trained, slim)
if ("ars" %in% wanted) {
  one <- trained$ars$trainings[["1"]]
  results$one <- one
  results$one_lines <- utils::capture.output(print(one))
  results$provenance <- utils::capture.output(print(provenance(trained$ars)))
}
saveRDS(results, file, compress = "xz", version = 3)
cat(format(file.size(file), big.mark = ","), "bytes\n")
for (name in names(trained)) print(trained[[name]])
