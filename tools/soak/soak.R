# One of the clients of soak.py, from R.
#
#   Rscript soak.R PORT SEED SECONDS

library(gym)
arguments <- as.numeric(commandArgs(TRUE))
client <- create_GymClient(sprintf("http://127.0.0.1:%.0f", arguments[[1]]))
set.seed(arguments[[2]])
end <- Sys.time() + arguments[[3]]
options(gym.viewer = FALSE)
while (Sys.time() < end) {
  num_envs <- sample(list(NULL, 16L), 1)[[1]]
  env <- gym_make("CartPole-v1", num_envs = num_envs, client = client)
  env$reset(seed = sample(1000, 1))
  for (i in seq_len(sample(200, 1))) {
    out <- env$step(sample(0:1, max(num_envs, 1L), replace = TRUE))
    stopifnot(length(out$reward) == max(num_envs, 1L))
    if (is.null(num_envs) && (out$terminated || out$truncated)) env$reset()
    if (Sys.time() > end) break
  }
  if (runif(1) < 0.3) {
    env_watch(client, env$instance_id)
    get_request(client, paste0("/v1/envs/", env$instance_id, "/watch/state/"))
    stopifnot(length(dim(env$render())) >= 2L)
  }
  # Those that are forgotten are closed with the session.
  if (runif(1) < 0.8) env$close()
}
