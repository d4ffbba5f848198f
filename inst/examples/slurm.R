# Many trainings on a cluster with a queue: a job for each seed.
#
# On a machine with Slurm the script submits each job with `slurm.tmpl`, from the same folder.
# Elsewhere it runs the jobs one after the other, so that you can try it out.
#
# Each job writes its own checkpoint and log in a folder that all machines share. If a job ends
# before its training does, run the script again to resume it.

library(gym)

here <- system.file("examples", package = "gym")
folder <- Sys.getenv("GYM_RESULTS", tempdir())

if (nzchar(Sys.which("sbatch"))) {
  jobs <- future::tweak(
    future.batchtools::batchtools_slurm, template = file.path(here, "slurm.tmpl"),
    resources = list(cores = 4, hours = 2, memory = 2000)
  )
  # Within a job, the training uses its four cores.
  future::plan(list(jobs, future::tweak(future::multisession, workers = I(4))))
} else {
  future::plan(future.batchtools::batchtools_local)
}

trained <- train_agent(
  agent_ars(directions = 8, top = 4), "Acrobot-v1", policy_linear(normalize = TRUE),
  iterations = 5, seeds = 1:2, eval_episodes = 20,
  checkpoint = file.path(folder, "acrobot.rds"), log = file.path(folder, "acrobot")
)
print(trained)

future::plan("sequential")
