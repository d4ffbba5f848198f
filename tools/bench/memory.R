# Measures how much memory R and its server need after a million steps, and how much many
# sub-environments need. Runs in its own process and prints lines "WHAT: MB".

library(gym)

# Resident memory. Some Linux systems have no ps, and only Linux has /proc.
megabytes <- function(pid) {
  status <- file.path("/proc", pid, "status")
  kilobytes <- if (file.exists(status)) {
    gsub("[^0-9]", "", grep("^VmRSS", readLines(status), value = TRUE))
  } else {
    system2("ps", c("-o", "rss=", "-p", pid), stdout = TRUE)
  }
  as.numeric(kilobytes) * 1024 / 1e6
}

tell <- function(what, value) {
  cat(what, ": ", format(value), "\n", sep = "")
}

# A hundred single steps and nine of a hundred sub-environments.
play_thousand <- function(env, vector_env, actions) {
  for (action in rep_len(0:1, 100L)) {
    if (env$step(action)$done) env$reset()
  }
  for (i in seq_len(9L)) vector_env$step(actions[[1L + i %% 2L]])
}

# For R, also the memory of objects in use.
tell_sizes <- function(server_pid, steps) {
  living <- sum(gc()[, 2L])
  after <- paste("after", format(steps, big.mark = ",", scientific = FALSE), "steps")
  tell(paste("R's objects", after), living)
  tell(paste("R", after), megabytes(Sys.getpid()))
  tell(paste("server", after), megabytes(server_pid))
}

# R collects garbage only when its heap is full, so fill it once before measuring.
fill_heap <- function() {
  for (i in seq_len(5e5)) list(i, raw(256), numeric(100), raw(1000), raw(3000))
}

fill_heap()
million <- as.numeric(commandArgs(trailingOnly = TRUE)[1L])
client <- gym_server_start()
server_pid <- get_request(client, "/v1/health/")$pid
env <- gym_make("CartPole-v1", seed = 1, client = client)
vector_env <- gym_make("CartPole-v1", num_envs = 100, seed = 1, client = client)
invisible(env$reset())
invisible(vector_env$reset())
actions <- list(rep_len(0:1, 100L), rep_len(1:0, 100L))
told <- unique(pmin(c(10, 100, 1000), million / 1000))
for (thousand in seq_len(million / 1000)) {
  play_thousand(env, vector_env, actions)
  # R's small collections leave some garbage behind, which would count as growth.
  if (thousand %% 100 == 0) gc()
  if (thousand %in% told) tell_sizes(server_pid, thousand * 1000)
}

before <- megabytes(server_pid)
many <- gym_make("CartPole-v1", num_envs = 8192, seed = 1, client = client)
invisible(many$reset())
for (i in seq_len(10L)) many$step(rep_len(0:1, 8192L))
tell("server for 8192 sub-environments", megabytes(server_pid) - before)
