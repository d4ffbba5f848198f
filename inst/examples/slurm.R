# Many trainings on a cluster with a queue: a job for each seed.
#
# On a machine that can submit jobs to Slurm each job is asked for by `slurm.tmpl`, which lies
# beside this file. Elsewhere the same script runs its jobs one after the other, to try it out.
#
# Every job makes its own checkpoint and log in a folder that all machines see. A job that has ended
# before its training goes on from there when the script is run again.

library(gym)

here <- system.file("examples", package = "gym")
folder <- Sys.getenv("GYM_RESULTS", tempdir())

if (nzchar(Sys.which("sbatch"))) {
  jobs <- future::tweak(
    future.batchtools::batchtools_slurm, template = file.path(here, "slurm.tmpl"),
    resources = list(cores = 4, hours = 2, memory = 2000)
  )
  # Within a job the training plays on its four cores.
  future::plan(list(jobs, future::tweak(future::multisession, workers = I(4))))
} else {
  future::plan(future.batchtools::batchtools_local)
}

trained <- train_agent(
  agent_ars(directions = 8, top = 4), "Acrobot-v1", policy_linear(normalize = TRUE),
  iterations = 5, seeds = 1:3, eval_episodes = 20,
  checkpoint = file.path(folder, "acrobot.rds"), log = file.path(folder, "acrobot")
)
print(trained)
print(summary(trained))

future::plan("sequential")
