# Trains one seed of a job of the table of solved environments, in a process of its own:
# Rscript tools/solve/train.R ROW SEED FILE. FILE gets a list of two tables, which
# tools/solve-table.R puts together.
suppressMessages(library(gym))
source("tools/solve/jobs.R")

given <- commandArgs(trailingOnly = TRUE)
job <- solve_jobs[as.integer(given[[1L]]), ]
search <- switch(job$agent, ars = search_ars, cem = search_cem)
# One core for each seed: the sub-environments stay in the server's own process.
training <- suppressMessages(do.call(search, c(
  list(env = job$env_id), job_kwargs(job$kwargs),
  list(seed = as.integer(given[[2L]]), num_workers = 0, progress = FALSE)
)))

final <- training$final
from <- provenance(training)
reported <- cbind(
  job[c("env_id", "kwargs", "target", "target_source")],
  data.frame(
    agent = format(training$agent), policy = format(training$policy),
    origin = from$preset$origin, train_target = training$target, seed = training$seed,
    reached = final$mean_return >= job$target, solved = training$solved,
    iterations = nrow(training$history), steps = training$steps,
    eval_steps = sum(training$evaluations$steps),
    final[c("mean_return", "se", "lower", "upper", "episodes")],
    seconds = round(training$elapsed, 1), date = format(from$started, "%Y-%m-%d"),
    gym = from$gym, R = from$R, gymnasium = from$server$gymnasium, numpy = from$server$numpy,
    python = from$server$python, platform = from$platform, BLAS = basename(from$BLAS)
  )
)
evaluations <- training$evaluations
curve <- cbind(
  job[c("env_id", "kwargs")],
  data.frame(
    seed = training$seed, iteration = evaluations$iteration,
    steps = training$history$steps[evaluations$iteration], kind = evaluations$kind,
    mean_return = round(evaluations$mean_return, 2), episodes = evaluations$episodes
  )
)
saveRDS(list(table = reported, curve = curve), given[[3L]])
