# Trains one seed of a job of the table of solved environments, in a process of its own:
# Rscript tools/solve/train.R ROW SEED FILE. FILE gets a list of two tables, which
# tools/solve-table.R puts together.
suppressMessages(library(gym))
source("tools/solve/jobs.R")
source("tools/bench/cpu.R")

given <- commandArgs(trailingOnly = TRUE)
job <- solve_jobs[as.integer(given[[1L]]), ]
search <- switch(job$method, ars = search_ars, cem = search_cem, ppo = learn_ppo,
                 reinforce = learn_reinforce, dqn = learn_dqn)
# What R, the server and its workers use of the processor. It says more than time does when other
# trainings run beside this one.
server <- server_pid(gym_client())
used <- function() cpu_seconds(c(Sys.getpid(), server, descendants(server)))
before <- used()
# One core for each seed: the sub-environments stay in the server's own process.
training <- suppressMessages(do.call(search, c(
  list(env = job$env_id), job_kwargs(job$kwargs),
  list(target = job$train_target, seed = as.integer(given[[2L]]), num_workers = 0, progress = FALSE)
)))
processor <- round(used() - before, 1)

# What the policy earns where it draws its actions, as it did in training; the final evaluation
# takes the most likely one.
drawn_return <- if (job$method %in% c("ppo", "reinforce")) {
  do.call(evaluate_policy, c(
    list(job$env_id, agent_behavior(training$agent), episodes = 100, seed = training$seed),
    job_kwargs(job$kwargs)
  ))$mean_return
} else {
  NA_real_
}

final <- training$final
from <- provenance(training)
reported <- cbind(
  job[c("env_id", "kwargs", "method", "target", "target_source")],
  data.frame(
    agent = format(training$agent), policy = format(training$policy),
    origin = from$preset$origin, train_target = training$target, seed = training$seed,
    reached = final$mean_return >= job$target, stopped_early = training$stopped_early,
    iterations = nrow(training$history), steps = training$steps,
    eval_steps = sum(training$evaluations$steps),
    final[c("mean_return", "se", "lower", "upper", "episodes")], drawn_return = drawn_return,
    seconds = round(training$elapsed, 1), cpu_seconds = processor,
    date = format(from$started, "%Y-%m-%d"),
    gym = from$gym, R = from$R, gymnasium = from$server$gymnasium, numpy = from$server$numpy,
    python = from$server$python, platform = from$platform, BLAS = name_of_blas(from$BLAS)
  )
)
evaluations <- training$evaluations
curve <- cbind(
  job[c("env_id", "kwargs", "method")],
  data.frame(
    seed = training$seed, iteration = evaluations$iteration,
    steps = c(0, training$history$steps)[evaluations$iteration + 1L], kind = evaluations$kind,
    # The file is part of the package, which must stay small.
    mean_return = round(evaluations$mean_return, ifelse(evaluations$kind == "final", 2, 1)),
    episodes = evaluations$episodes
  )
)
saveRDS(list(table = reported, curve = curve), given[[3L]])
