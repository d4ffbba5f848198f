# One of the clients of clients.py. It plays what the file describes and records its observations.
#
#   Rscript clients.R PORT FILE

library(gym)
arguments <- commandArgs(TRUE)
task <- jsonlite::fromJSON(arguments[[2]])
client <- create_GymClient(paste0("http://127.0.0.1:", arguments[[1]]))
num_actions <- task$steps * task$actions_a_step
actions <- matrix(readBin(task$actions, "double", num_actions), task$actions_a_step)
vector <- !is.null(task$num_envs)
env <- gym_make(task$env_id, num_envs = task$num_envs, client = client)
rows <- function(x) if (is.matrix(x)) as.vector(t(x)) else as.vector(x)

seen <- vector("list", 2 * task$steps)
invisible(env$reset(seed = task$seed))
for (i in seq_len(task$steps)) {
  action <- actions[, i]
  out <- env$step(if (vector && task$box) matrix(action) else action)
  ended <- !vector && (out$terminated || out$truncated)
  seen[[2 * i - 1]] <- c(rows(out$observation), out$reward, out$terminated, out$truncated)
  if (ended) seen[[2 * i]] <- as.vector(env$reset())
}
env$close()
writeBin(as.double(unlist(seen)), task$seen)
