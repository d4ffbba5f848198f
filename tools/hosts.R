# Shows that trainings run on other hosts: two hosts on this machine, each a network namespace with
# its own address and core. Measures how much faster training gets, how much time a batch takes
# besides playing, and how workers of a plan compare with worker processes of the server. Also shows
# what happens to a training when a worker, a server or a host is lost. Needs Linux and root. If
# namespaces are not allowed, the hosts are only processes.
#
#   tools/in-env Rscript --no-init-file tools/hosts.R [rates] [faults] [ways]      runs parts
#   tools/in-env Rscript --no-init-file tools/hosts.R faults one                   one fault only

library(gym)

# Otherwise R waits some 40 ms for an acknowledgement before it sends the rest of a larger message.
options(socketOptions = "no-delay")

# Hosts ----------------------------------------------------------------------------------

# The names contain the id of this process, so that two runs of this script do not use the same
# hosts.
hosts <- paste0("gym-", Sys.getpid(), "-", 0:1)
number_of <- function(host) as.integer(sub(".*-", "", host))
owner_of <- function(host) sub("gym-([0-9]+)-.*", "\\1", host)
network_of <- function(host) {
  paste0("10.77.", 2L * (as.integer(owner_of(host)) %% 128L) + number_of(host))
}
session_address <- function(host) paste0(network_of(host), ".1")
host_address <- function(host) paste0(network_of(host), ".2")
session_link <- function(host) host

ip <- function(...) {
  system2("ip", c(...), stdout = FALSE, stderr = FALSE) == 0L
}

# A virtual cable connects each host with the session.
make_host <- function(host) {
  link <- session_link(host)
  commands <- list(
    c("netns", "add", host),
    c("link", "add", link, "type", "veth", "peer", "name", "eth0", "netns", host),
    c("address", "add", paste0(session_address(host), "/24"), "dev", link),
    c("link", "set", link, "up"),
    c("-n", host, "address", "add", paste0(host_address(host), "/24"), "dev", "eth0"),
    c("-n", host, "link", "set", "eth0", "up"),
    c("-n", host, "link", "set", "lo", "up"),
    # Give up a connection that is cut after seconds, not after a quarter of an hour.
    c("netns", "exec", host, "sysctl", "-qw", "net.ipv4.tcp_retries2=3")
  )
  all(vapply(commands, ip, NA))
}

has_ip <- nzchar(Sys.which("ip"))

# First remove the namespaces of earlier runs that were killed.
make_hosts <- function() {
  if (has_ip) remove_hosts(left_hosts())
  made <- has_ip && all(vapply(hosts, make_host, NA))
  if (!made) {
    remove_hosts()
    message("Network namespaces are not allowed here, so the hosts are ordinary processes.")
  }
  made
}

# Kills only processes of the hosts, by their ids.
clear_host <- function(host) {
  tools::pskill(pids_on(host), tools::SIGKILL)
}

left_hosts <- function() {
  names <- system2("ip", c("netns", "list"), stdout = TRUE, stderr = FALSE)
  found <- grep("^gym-[0-9]+-[01]$", sub(" .*", "", names), value = TRUE)
  found[!dir.exists(file.path("/proc", owner_of(found)))]
}

remove_hosts <- function(which = hosts) {
  for (host in which) {
    clear_host(host)
    if (!has_ip) next
    ip("netns", "delete", host)
    # The other end of the cable disappears with it, but not at once.
    ip("link", "delete", session_link(host))
  }
}

pids_on <- function(host) {
  in_namespace <- if (has_ip) {
    suppressWarnings(system2("ip", c("netns", "pids", host), stdout = TRUE, stderr = FALSE))
  }
  known <- has_ip && is.null(attr(in_namespace, "status"))
  as.integer(if (known) in_namespace else pids_with(paste0("TMPDIR=", tmp_of(host))))
}

# If a host is only a name, its processes are those whose environment says so.
pids_with <- function(variable) {
  files <- Sys.glob("/proc/[0-9]*/environ")
  has <- vapply(files, function(file) {
    # A process may end meanwhile. If a warning ended the reading, the file's connection would stay
    # open, and R has only 128.
    bytes <- suppressWarnings(tryCatch(readBin(file, "raw", 1e5), error = function(cnd) raw()))
    lines <- rawToChar(replace(bytes, bytes == 0L, as.raw(10L)))
    variable %in% strsplit(lines, "\n", fixed = TRUE)[[1L]]
  }, NA)
  basename(dirname(files[has]))
}

tmp_of <- function(host) file.path(Sys.getenv("GYM_HOSTS_TMP"), host)

# Returns the processes of a host of one kind, "R" or "python".
pids_of_kind <- function(host, kind) {
  Filter(function(pid) {
    name <- suppressWarnings(try(readLines(file.path("/proc", pid, "comm")), silent = TRUE))
    startsWith(name[[1L]], kind)
  }, pids_on(host))
}

# Workers --------------------------------------------------------------------------------

# Sets a plan with workers on some hosts.
start_workers <- function(on, namespaces) {
  nodes <- lapply(on, function(host) {
    dir.create(tmp_of(host), showWarnings = FALSE)
    parallelly::makeClusterPSOCK(
      host, master = if (namespaces) session_address(host) else "localhost", port = "random",
      revtunnel = FALSE, homogeneous = TRUE, autoStop = FALSE, verbose = FALSE,
      rshcmd = file.path(getwd(), "tools", "in-host"), rshopts = character(),
      rscript = file.path(R.home("bin"), "Rscript"), rscript_args = "--no-init-file"
    )[[1L]]
  })
  workers <- structure(nodes, class = c("SOCKcluster", "cluster"))
  future::plan(future::cluster, workers = workers)
  workers
}

stop_workers <- function(workers) {
  future::plan(future::sequential)
  for (worker in seq_along(workers)) {
    try(parallel::stopCluster(workers[worker]), silent = TRUE)
  }
}

with_workers <- function(on, namespaces, code) {
  workers <- start_workers(on, namespaces)
  on.exit(stop_workers(workers))
  code
}

# Trainings ------------------------------------------------------------------------------

train <- function(env = "LunarLander-v3", iterations = 7, directions = 32, ...) {
  train_agent(
    agent_ars(directions = directions, top = directions / 2), env, policy_linear(normalize = TRUE),
    iterations = iterations, seed = 3, eval_episodes = 20, eval_every = 1000, ...
  )
}

# Steps a second. The first iteration makes environments and starts servers, and does not count.
rate_of <- function(training) {
  history <- training$history
  last <- nrow(history)
  (history$steps[[last]] - history$steps[[1L]]) / (history$elapsed[[last]] - history$elapsed[[1L]])
}

what_counts <- function(training) {
  history <- training$history
  history$elapsed <- NULL
  list(history, stats::coef(training), training$final)
}

show_table <- function(title, table) {
  cat("\n", title, "\n\n", sep = "")
  print(table, row.names = FALSE, right = FALSE)
}

# Rates ----------------------------------------------------------------------------------

# Measures how much time a batch takes besides playing: the session's seconds in play_in_futures()
# minus the seconds that the slowest worker reports, and the session's seconds between batches.
batches <- new.env()

watch_batches <- function() {
  batches$rows <- list()
  now <- function() proc.time()[["elapsed"]]
  batches$enter <- function() {
    batches$slowest <- 0
    batches$began <- now()
  }
  batches$take <- function(state) batches$slowest <- max(batches$slowest, state$seconds)
  batches$leave <- function() {
    row <- c(began = batches$began, ended = now(), slowest = batches$slowest)
    batches$rows <- c(batches$rows, list(row))
  }
  watch <- function(name, ...) {
    suppressMessages(trace(name, ..., where = asNamespace("gym"), print = FALSE))
  }
  watch("play_in_futures", tracer = batches$enter, exit = batches$leave)
  watch("warn_of_blas", tracer = quote(get("batches", globalenv())$take(state)))
}

forget_batches <- function() {
  suppressMessages(untrace("play_in_futures", where = asNamespace("gym")))
  suppressMessages(untrace("warn_of_blas", where = asNamespace("gym")))
}

# Returns medians over the batches of a training, in milliseconds, without the first batch and the
# final evaluation.
batch_costs <- function() {
  rows <- do.call(rbind, utils::head(batches$rows, -1L))
  took <- (rows[, "ended"] - rows[, "began"])[-1L]
  between <- rows[-1L, "began"] - rows[-nrow(rows), "ended"]
  1000 * c(
    batch = stats::median(took), sending = stats::median(took - rows[-1L, "slowest"]),
    between = stats::median(between)
  )
}

measure <- function(workers, directions) {
  future::plan(future::cluster, workers = workers)
  watch_batches()
  on.exit(forget_batches())
  c(rate = rate_of(train(directions = directions, iterations = 5)), batch_costs())
}

# The speed of the cores changes over time. So one host and two hosts take short turns, with workers
# that are kept, and each turn gives a ratio.
report_rates <- function(namespaces, turns = 6L) {
  workers <- start_workers(hosts, namespaces)
  on.exit(stop_workers(workers))
  rows <- lapply(rep(c(32, 256, 512), turns), function(directions) {
    one <- measure(workers[1L], directions)
    two <- measure(workers, directions)
    data.frame(
      directions = directions, one = one[["rate"]], two = two[["rate"]],
      ratio = two[["rate"]] / one[["rate"]], batch_ms = two[["batch"]],
      sending_ms = two[["sending"]], between_ms = two[["between"]]
    )
  })
  table <- do.call(rbind, rows)
  in_turns <- split(table, table$directions)
  medians <- do.call(rbind, lapply(in_turns, function(own) {
    data.frame(
      lapply(own, stats::median), least_ratio = min(own$ratio), greatest_ratio = max(own$ratio)
    )
  }))
  ratios <- grep("ratio", names(medians))
  medians[ratios] <- round(medians[ratios], 2)
  medians[-ratios] <- round(medians[-ratios])
  show_table("Steps a second of LunarLander-v3 on one and on two hosts, their ratio, and of a batch
on two hosts the milliseconds: all, those beside the slowest worker's own, those until the next
batch begins; medians of turns", medians)
}

# Faults ---------------------------------------------------------------------------------

# Causes the fault a moment after an iteration's batch was sent.
later <- function(...) {
  system2("sh", c("-c", shQuote(paste("sleep 0.15;", paste(...)))), wait = FALSE)
}

kill_first <- function(kind) {
  force(kind)
  function(host) later("kill -9", pids_of_kind(host, kind)[[1L]])
}

faults <- list(
  "none" = function(host) NULL,
  "worker killed" = kill_first("R"),
  "server killed" = kill_first("python"),
  "link down" = function(host) later("ip -n", host, "link set eth0 down")
)

# Trains, with a fault on the second host in the third iteration, and returns what happened.
train_with <- function(fault) {
  warnings <- character()
  started <- proc.time()[["elapsed"]]
  training <- withCallingHandlers(
    train(iterations = 6, callback = function(training) {
      if (nrow(training$history) == 2L) faults[[fault]](hosts[[2L]])
      NULL
    }),
    warning = function(cnd) {
      warnings <<- c(warnings, conditionMessage(cnd))
      invokeRestart("muffleWarning")
    }
  )
  list(
    counts = what_counts(training), warnings = warnings,
    seconds = proc.time()[["elapsed"]] - started
  )
}

wait_until <- function(done, seconds) {
  deadline <- Sys.time() + seconds
  while (!done() && Sys.time() < deadline) Sys.sleep(0.1)
}

# Counts the processes of a kind, or the files, on all hosts.
count_on <- function(what) sum(lengths(lapply(hosts, what)))

logs_on <- function(host) {
  list.files(tmp_of(host), "^gym-server-.*[.]log$", recursive = TRUE)
}

fault_row <- function(fault, expected, namespaces) {
  old <- options(gym.batch_deadline = if (fault == "link down") 5)
  on.exit(options(old))
  with_workers(hosts, namespaces, trained <- train_with(fault))
  wait_until(function() !count_on(pids_on), 20)
  row <- data.frame(
    fault = fault, equal = identical(trained$counts, expected),
    seconds = round(trained$seconds, 1), warnings = length(trained$warnings),
    workers_left = count_on(function(host) pids_of_kind(host, "R")),
    servers_left = count_on(function(host) pids_of_kind(host, "python")),
    logs_left = count_on(logs_on)
  )
  row$text <- list(trained$warnings)
  lapply(hosts, clear_host)
  unlink(vapply(hosts, tmp_of, ""), recursive = TRUE)
  if (namespaces) ip("-n", hosts[[2L]], "link", "set", "eth0", "up")
  row
}

report_faults <- function(namespaces, one) {
  expected <- what_counts(train(iterations = 6))
  possible <- if (namespaces) names(faults) else setdiff(names(faults), "link down")
  if (one) possible <- if (namespaces) "link down" else "worker killed"
  table <- do.call(rbind, lapply(possible, fault_row, expected, namespaces))
  show_table("Faults on the second of two hosts, in the third of six iterations: is the result that
of the session alone, and what is left 20 seconds after the end of the workers at most",
             table[setdiff(names(table), "text")])
  for (row in seq_len(nrow(table))) {
    text <- table$text[[row]]
    if (length(text)) cat("\n", table$fault[[row]], ":\n", paste0("  ", text, "\n"), sep = "")
  }
  if (!all(table$equal) || any(table[c("workers_left", "servers_left", "logs_left")] > 0L)) {
    stop("A result differs, or something is left.")
  }
}

# Ways to play on this machine -----------------------------------------------------------

on_sessions <- function(workers) {
  force(workers)
  function(...) {
    future::plan(future::multisession, workers = workers)
    on.exit(future::plan(future::sequential))
    rate_of(train(...))
  }
}

ways <- list(
  "one process" = function(...) rate_of(train(..., num_workers = 0)),
  "num_workers = 2" = function(...) rate_of(train(..., num_workers = 2)),
  "multisession, 2" = on_sessions(2), "multisession, 4" = on_sessions(4)
)

tasks <- list(
  list(env = "Pendulum-v1"), list(env = "LunarLander-v3"),
  list(env = "LunarLander-v3", directions = 256, iterations = 4),
  list(env = "BipedalWalker-v3", max_steps = 200, iterations = 4)
)

report_ways <- function(turns = 3L) {
  rows <- lapply(tasks, function(task) {
    rates <- replicate(turns, vapply(ways, function(way) do.call(way, task), 0))
    medians <- apply(rates, 1L, stats::median)
    data.frame(env = task$env, directions = if (is.null(task$directions)) 32 else task$directions,
               as.list(round(medians)), best = names(which.max(medians)), check.names = FALSE)
  })
  show_table("Steps a second on this machine, medians of turns", do.call(rbind, rows))
}

prove <- function(parts) {
  Sys.setenv(GYM_HOSTS_TMP = tempfile("hosts-"))
  dir.create(Sys.getenv("GYM_HOSTS_TMP"))
  namespaces <- make_hosts()
  on.exit(remove_hosts())
  if ("rates" %in% parts) report_rates(namespaces)
  if ("faults" %in% parts) report_faults(namespaces, "one" %in% parts)
  if ("ways" %in% parts) report_ways()
}

parts <- commandArgs(trailingOnly = TRUE)
prove(if (length(parts)) parts else c("rates", "faults", "ways"))
