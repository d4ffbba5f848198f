# Compares this build with another one, such as that of an earlier commit, which is installed in
# another library:
#
#   GYM_BENCH_LIBRARY=/path/to/library make bench PARTS=stream
#
# Each runs in its own process with its own server, and they take turns.

# For each measurement of stepper.R, how many times as fast this build should be.
stream_tasks <- list(
  list("step CartPole-v1 0 160", "env$step()", 2.7),
  list("classic CartPole-v1 0 160", "env_step()", 2.5),
  list("step CartPole-v1 32 160", "env$step(), 32", 2.3),
  list("step CartPole-v1 1024 80", "env$step(), 1,024", 1.5),
  list("step CartPole-v1 8192 40", "env$step(), 8,192", 1),
  list("step ALE/Pong-v5 0 40", "env$step(), frames of Pong", 1.2),
  list("rollout LunarLander-v3 0 64", "rollout() of LunarLander, function", 1.3),
  list("learn Taxi-v4 0 1000", "learn_q() of Taxi, step by step", 2.5)
)

builds <- c("gym, this build", "gym, other build")

compare_builds <- function(turns) {
  library <- Sys.getenv("GYM_BENCH_LIBRARY")
  if (!nzchar(library)) stop("GYM_BENCH_LIBRARY names the library of the other build.")
  start <- function(library) {
    start_worker(
      file.path(R.home("bin"), "Rscript"), c("--no-init-file", "tools/bench/stepper.R"),
      c(R_LIBS = paste(c(library, Sys.getenv("R_LIBS")), collapse = .Platform$path.sep))
    )
  }
  workers <- list(start(NULL), start(library))
  on.exit(for (worker in workers) end_worker(worker))
  do.call(rbind, lapply(stream_tasks, function(task) {
    progress(task[[2L]])
    for (worker in workers) ask(worker, task[[1L]])
    do.call(rbind, lapply(seq_len(turns), function(turn) {
      order <- if (turn %% 2L) 1:2 else 2:1
      do.call(rbind, lapply(order, function(i) {
        measured("stream", 0, builds[[i]], task[[1L]], turn, ask(workers[[i]], task[[1L]]),
                 if (grepl("^(step|classic)", task[[1L]])) "microseconds" else "s",
                 env_id = task[[2L]])
      }))
    }))
  }))
}

stream_goals <- function(rows) {
  lapply(stream_tasks, function(task) {
    values <- lapply(builds, function(build) {
      values_of(rows, "stream", build, env_id = task[[2L]])
    })
    goal(paste0(task[[2L]], ": at least ", task[[3L]], " times the other build"),
         stats::median(values[[2L]] / values[[1L]]), at_least = task[[3L]])
  })
}
