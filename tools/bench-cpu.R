# Shows where the time of a rollout goes: for each environment of the benchmark, the seconds that
# rollout() takes, the CPU seconds of R, of the server and of its worker processes, and the seconds
# of Python's own loop over as many episodes. All are medians of three turns. Needs Linux, which
# shows the time of a process in /proc.
#
#   tools/in-env Rscript --no-init-file tools/bench-cpu.R [LunarLander-v3 ...]

library(gym)
for (file in c("turns", "workers", "cpu", "tasks", "rollouts")) {
  source(file.path("tools", "bench", paste0(file, ".R")))
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
  server <- server_pid(setup$client)
  each <- vapply(seq_len(turns), function(turn) {
    processes <- list(R = Sys.getpid(), server = server, workers = descendants(server))
    before <- vapply(processes, cpu_seconds, 0)
    took <- seconds_of(steps <- play())
    used <- vapply(processes, cpu_seconds, 0) - before
    c(rollout = took, used, loop = steps / loop(task$episodes))
  }, numeric(5L))
  apply(each, 1L, stats::median)
}

wanted <- commandArgs(trailingOnly = TRUE)
chosen <- if (length(wanted)) tasks[wanted] else tasks
on_cores(rollout_cores, {
  setup <- start_contenders(Sys.getenv("GYM_PYTHON"))
  measured <- t(vapply(chosen, measure_task, numeric(5L), setup = setup))
  stop_contenders(setup)
})
print(cbind(signif(measured, 3), ratio = signif(measured[, "loop"] / measured[, "rollout"], 3)))
