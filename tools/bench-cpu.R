# Where the time of a rollout goes: for each environment of the benchmark the seconds that rollout()
# takes, and the processor's seconds of R, of the server and of its worker processes, beside the
# seconds of Python's own loop over as many episodes. Medians of three turns. Only on Linux, which
# shows a process's time in /proc.
#
#   tools/in-env Rscript --no-init-file tools/bench-cpu.R [LunarLander-v3 ...]

library(gym)
for (file in c("turns", "workers", "tasks", "rollouts")) {
  source(file.path("tools", "bench", paste0(file, ".R")))
}

# The seconds that all threads of some processes have run.
cpu_seconds <- function(pids) {
  files <- Sys.glob(file.path("/proc", pids, "task", "*", "schedstat"))
  times <- vapply(files, function(file) {
    # A thread may end meanwhile.
    line <- tryCatch(readLines(file), error = function(cnd) "0", warning = function(cnd) "0")
    as.numeric(strsplit(line, " ")[[1L]][[1L]])
  }, 0)
  sum(times) / 1e9
}

# The processes that a process has started, and those that these have.
descendants <- function(pid) {
  table <- utils::read.table(text = system2("ps", c("-eo", "pid=,ppid="), stdout = TRUE))
  found <- pid
  repeat {
    more <- setdiff(table[[1L]][table[[2L]] %in% found], found)
    if (!length(more)) {
      return(setdiff(found, pid))
    }
    found <- c(found, more)
  }
}

seconds_of <- function(code) {
  started <- now()
  force(code)
  now() - started
}

measure_task <- function(setup, task, turns = 3L) {
  policy <- task_policy(task)
  play <- function(...) play_by_id(task, policy, task$episodes, setup$client, ...)
  loop <- python_loop(setup$python, task, list(task_numbers(task)))
  play(max_steps = 2)
  loop(2L)
  server <- client_health(setup$client)$pid
  each <- vapply(seq_len(turns), function(turn) {
    processes <- list(R = Sys.getpid(), server = server, workers = descendants(server))
    before <- vapply(processes, cpu_seconds, 0)
    took <- seconds_of(steps <- play())
    used <- vapply(processes, cpu_seconds, 0) - before
    c(rollout = took, used, loop = steps / loop(task$episodes))
  }, numeric(5L))
  apply(each, 1L, stats::median)
}

client_health <- function(client) get_request(client, "/v1/health/")

wanted <- commandArgs(trailingOnly = TRUE)
chosen <- if (length(wanted)) tasks[wanted] else tasks
on_cores(rollout_cores, {
  setup <- start_contenders(Sys.getenv("GYM_PYTHON"))
  measured <- t(vapply(chosen, measure_task, numeric(5L), setup = setup))
  stop_contenders(setup)
})
print(cbind(signif(measured, 3), ratio = signif(measured[, "loop"] / measured[, "rollout"], 3)))
