# Trains one seed of a job of the table of learners, in its own process: Rscript tools/learn/train.R
# ENV_ID SEED FILE. It writes the table's row to FILE.
suppressMessages(library(gym))
source("tools/learn/blackjack.R")
source("tools/learn/jobs.R")

given <- commandArgs(trailingOnly = TRUE)
job <- learn_jobs[[given[[1L]]]]
learned <- job$learn(as.integer(given[[2L]]))
value <- job$judge(learned)
from <- provenance(learned)
row <- data.frame(
  env_id = job$env_id, learner = format(learned$agent), goal = job$goal, measure = job$measure,
  seed = learned$seed, value = value, reached = value >= job$goal,
  iterations = nrow(learned$history), steps = learned$steps,
  seconds = round(learned$elapsed, 1), date = format(from$started, "%Y-%m-%d"),
  gym = from$gym, R = from$R, gymnasium = from$server$gymnasium
)
saveRDS(row, given[[3L]])
