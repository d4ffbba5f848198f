# One of the clients of clients.py: plays as the file says and writes down what it saw.
#
#   Rscript clients.R PORT FILE

library(gym)
arguments <- commandArgs(TRUE)
told <- jsonlite::fromJSON(arguments[[2]])
client <- create_GymClient(paste0("http://127.0.0.1:", arguments[[1]]))
actions <- matrix(readBin(told$actions, "double", told$steps * told$sub_envs), told$sub_envs)
vector <- !is.null(told$num_envs)
env <- gym_make(told$env_id, num_envs = told$num_envs, client = client)
rows <- function(x) if (is.matrix(x)) as.vector(t(x)) else as.vector(x)

seen <- vector("list", 2 * told$steps)
invisible(env$reset(seed = told$seed))
for (i in seq_len(told$steps)) {
  action <- actions[, i]
  out <- env$step(if (vector && told$box) matrix(action) else action)
  ended <- !vector && (out$terminated || out$truncated)
  seen[[2 * i - 1]] <- c(rows(out$observation), out$reward, out$terminated, out$truncated)
  if (ended) seen[[2 * i]] <- as.vector(env$reset())
}
env$close()
writeBin(as.double(unlist(seen)), told$seen)
