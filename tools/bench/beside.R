# Measures rollouts beside the environment, other than steps a second: a search that takes some
# milliseconds, many long episodes, a slow network connection, memory, and a whole training.

compare_beside <- function(python, turns, quick) {
  on_cores(rollout_cores, {
    client <- gym_server_start(python = python, token = FALSE)
    on.exit(gym_server_stop(client))
    slow <- start_slow_proxy(python, client)
    on.exit(slow$process$kill(), add = TRUE)
    far <- create_GymClient(slow$address)
    rbind(
      measure_rollout_memory(client),
      do.call(rbind, lapply(seq_len(turns), function(turn) {
        progress("beside, turn ", turn, " of ", turns)
        rbind(
          beside_row("search", "50 rounds, none solved", turn, search_seconds(client), "s"),
          beside_row("balancing", "4,096 episodes", turn, balancing_rate(client), "steps/s"),
          beside_row("gym", "256 episodes of LunarLander", turn, lander_seconds(client), "s"),
          beside_row("network", "256 episodes of LunarLander", turn, lander_seconds(far), "s")
        )
      })),
      if (!quick) beside_row("preset", "seed 1001", 1L, preset_seconds(client), "s")
    )
  })
}

beside_row <- function(name, called, turn, value, unit) {
  measured("beside", 0, rollout_names[[name]], called, turn, value, unit)
}

seconds_of <- function(code) system.time(code)[["elapsed"]]

# Time the second of two calls, because the first one asks for the description.
search_seconds <- function(client) {
  search <- function() {
    search_random("CartPole-v0", target = Inf, rounds = 50, seed = 1, client = client,
                  progress = FALSE)
  }
  search()
  seconds_of(search())
}

balancing_rate <- function(client) {
  policy <- policy_network(c(4, 1), "identity", list(matrix(c(0.1, 0.5, 5, 2), nrow = 1L)))
  play <- function() {
    sum(rollout("CartPole-v1", policy, 4096, seed = 1, client = client)$episodes$length)
  }
  play()
  rate_of(play)
}

lander_seconds <- function(client) {
  task <- tasks[["LunarLander-v3"]]
  play <- function(episodes) play_by_id(task, task_policy(task), episodes, client)
  play(8L)
  seconds_of(play(256L))
}

preset_seconds <- function(client) {
  seconds_of(
    search_ars("LunarLander-v3", continuous = TRUE, target = 220, seed = 1001, client = client,
               progress = FALSE)
  )
}

start_slow_proxy <- function(python, client) {
  port <- sub(".*:", "", client$remote_base)
  process <- processx::process$new(
    python, c("tools/bench/slow_proxy.py", port, "0.02"), stdout = "|", stderr = ""
  )
  port <- character()
  while (!length(port) && process$is_alive()) {
    process$poll_io(1000)
    port <- process$read_output_lines()
  }
  list(process = process, address = paste0("http://127.0.0.1:", port))
}

# The private memory of the server and its processes, in MB, after rollouts in two processes, minus
# that of an idle server.
measure_rollout_memory <- function(client) {
  if (!dir.exists("/proc")) {
    return(NULL)
  }
  pid <- server_pid(client)
  before <- private_megabytes(pid)
  lander_seconds(client)
  value <- private_megabytes(pid) - before
  beside_row("memory", "256 episodes of LunarLander", 1L, value, "MB")
}

private_megabytes <- function(pid) {
  parents <- vapply(list.files("/proc", "^[0-9]+$"), function(one) {
    stat <- tryCatch(readLines(file.path("/proc", one, "stat"), warn = FALSE),
                     error = function(cnd) "", warning = function(cnd) "")
    strsplit(sub(".*\\) ", "", stat), " ")[[1L]][2L]
  }, "")
  family <- as.character(pid)
  repeat {
    more <- setdiff(names(parents)[parents %in% family], family)
    if (!length(more)) break
    family <- c(family, more)
  }
  sum(vapply(family, function(one) {
    lines <- tryCatch(readLines(file.path("/proc", one, "smaps_rollup"), warn = FALSE),
                      error = function(cnd) "Private: 0 kB", warning = function(cnd) "")
    sum(as.numeric(gsub("[^0-9]", "", grep("^Private", lines, value = TRUE))))
  }, 0)) * 1024 / 1e6
}
