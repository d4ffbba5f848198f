# Computes the results of vignette("cartpole") and keeps them in vignettes/results.rds, so that the
# vignette builds without a server. tools/figures.R draws the README's pictures from them.
#
#   tools/in-env Rscript tools/vignette-results.R
#
# Takes some three minutes, most of them for the searches of 500 seeds.

library(gym)

started <- proc.time()[["elapsed"]]
follow_pole <- function(observation) as.integer(observation[, 3] > 0)

results <- list()
results$random <- rollout("CartPole-v0", policy_random(), episodes = 2000, seed = 2018)
results$follow <- rollout("CartPole-v0", follow_pole, episodes = 200, seed = 2018)
results$search <- search_random("CartPole-v0", seed = 2027)
results$summary <- summary(results$search, seed = 1)
results$episode <- rollout(
  "CartPole-v0", results$search$policy, seed = 1, steps = TRUE, frames = TRUE
)
# A megabyte; tools/figures.R makes the moving picture of them.
results$episode$frames <- NULL
results$map <- decision_map(
  "CartPole-v0", results$search$policy, "pole_angle", "pole_angular_velocity",
  path = results$episode
)
results$searches <- search_random("CartPole-v0", seeds = 1:500)

env <- gym_make("CartPole-v0")
observation <- env$reset(seed = 1)
for (step in 1:100) {
  observation <- env$step(act(results$search$policy, observation))$observation
}
results$frame <- env$render()
env$close()

console <- c(
  "library(gym)", "env <- gym_make(\"CartPole-v0\", seed = 1)", "env", "env$reset()",
  "str(env$step(1))", "env$close()"
)
results$console <- utils::capture.output(
  source(exprs = parse(text = console), echo = TRUE, spaced = FALSE)
)

results$versions <- c(
  gymnasium = get_request(gym_client(), "/v1/health/")$versions$gymnasium,
  R = format(getRversion())
)
results$date <- format(Sys.Date())

# A client belongs to the session that created it.
strip <- function(search) {
  search$client <- NULL
  search
}
# 500 searches with their episodes and policies would need megabytes.
results$searches$trainings <- lapply(results$searches$trainings, function(search) {
  kept <- c("seed", "history", "solved", "stopped_early", "steps", "elapsed", "interrupted",
            "env_id")
  search$history <- search$history["iteration"]
  structure(search[kept], class = class(search))
})
results$search <- strip(results$search)
results$summary$search <- results$search

saveRDS(results, "vignettes/results.rds", compress = "xz", version = 3)

print(as.data.frame(results$searches)[1:5, ])
cat(sprintf(
  "random policy: mean return %.2f, median %.1f over %d episodes\n",
  mean(results$random$episodes$return), stats::median(results$random$episodes$return),
  nrow(results$random$episodes)
))
cat(sprintf("%.0f seconds\n", proc.time()[["elapsed"]] - started))
