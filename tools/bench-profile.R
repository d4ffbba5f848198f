# Where the microseconds of one single step of CartPole go, on both sides; medians over rounds,
# in each of which everything is timed.
#
#   tools/in-env Rscript tools/bench-profile.R      writes vignettes/articles/bench-profile.csv

library(gym)
source("tools/bench/workers.R")
source("tools/bench/table.R")

rounds <- 9L
episodes <- 100L
steps <- 8L # With alternating actions no episode ends earlier.

clock <- function() as.numeric(Sys.time()) * 1e6

# Functions of the package whose share of a step is measured, none of which calls another: they
# check the action, write the request, parse the answer, look whose it is, and read it.
watched <- c("is_plain_whole", "line_json", "from_json", "is_echo", "read_quick_step")

# Sends steps through the worker's proxy, which keeps the last one as it went over the wire; the
# environment must not be closed over it.
record_step <- function(worker, url) {
  env <- gym_make("CartPole-v1", seed = 1, client = create_GymClient(ask(worker, "record", url)))
  # The number of the request gets four digits, which can then be counted up.
  for (episode in seq_len(1100L %/% steps)) {
    env$reset()
    for (action in rep_len(0:1, steps)) env$step(action)
  }
  env
}

# Puts a watch around the functions and around the call of curl, plays an episode's steps and
# returns the microseconds of a step: `whole` and those of each watched.
watch_steps <- function(env) {
  took <- new.env()
  watch <- function(name, original) {
    force(name)
    force(original)
    function(...) {
      started <- clock()
      value <- original(...)
      took[[name]] <- took[[name]] + clock() - started
      value
    }
  }
  connection <- gym:::client_state(env$client)$connection
  fetch <- connection$fetch
  connection$fetch <- watch("curl", fetch)
  originals <- mget(watched, asNamespace("gym"))
  for (name in watched) utils::assignInNamespace(name, watch(name, originals[[name]]), "gym")
  on.exit({
    connection$fetch <- fetch
    for (name in watched) utils::assignInNamespace(name, originals[[name]], "gym")
  })
  names <- c("whole", watched, "curl")
  step <- watch("whole", env$step)
  medians(function() {
    env$reset()
    for (name in names) took[[name]] <- 0
    for (action in rep_len(0:1, steps)) step(action)
    unlist(mget(names, took)) / steps
  })
}

medians <- function(episode) apply(replicate(episodes, episode()), 1L, stats::median)

profile <- function() {
  python <- Sys.getenv("GYM_PYTHON")
  worker <- start_worker(python, "tools/bench/profile_server.py")
  client <- gym_server_start(python = python, token = FALSE)
  on.exit({
    end_worker(worker)
    gym_server_stop(client)
  })
  recorded <- record_step(worker, client$remote_base)
  env <- gym_make("CartPole-v1", seed = 1, client = client)
  table <- profile_table(apply(replicate(rounds, time_round(worker, env)), 1L, stats::median))
  recorded$close()
  table
}

time_round <- function(worker, env) {
  own <- watch_steps(env)
  pause <- own[["whole"]] - own[["curl"]]
  c(
    own,
    socket = ask(worker, "round_trip", pause, env$client$remote_base),
    echo = ask(worker, "echo", pause),
    unlist(list(app = ask(worker, "application", pause)))
  )
}

profile_table <- function(took) {
  rest <- function(whole, parts) took[[whole]] - sum(took[parts])
  rbind(
    part("R: env$step(1)", took[["whole"]]),
    part(paste0("- ", watched, "()"), took[watched]),
    part("- all else in R", rest("whole", c(watched, "curl"))),
    part("- curl_fetch_memory(): all that follows", took[["curl"]]),
    part("curl_fetch_memory()", took[["curl"]]),
    part("- curl, which calls R for the body", rest("curl", "socket")),
    part("- the server, asked over a plain socket", took[["socket"]]),
    part("the server, asked over a plain socket", took[["socket"]]),
    part("- loopback: an echo of as many bytes", took[["echo"]]),
    part("- HTTP: reads the request, writes the answer, hands both on",
         rest("socket", c("echo", "app.whole"))),
    part("- the application", took[["app.whole"]]),
    part("the application", took[["app.whole"]]),
    part("- parses the JSON", took[["app.loads"]]),
    part("- Gymnasium's env.step()", took[["app.env"]]),
    part("- writes the JSON", took[["app.answer"]]),
    part("- routing, exactly once, the lock, checks, spaces",
         rest("app.whole", c("app.loads", "app.env", "app.answer")))
  )
}

part <- function(name, microseconds) {
  data.frame(part = name, microseconds = microseconds, row.names = NULL)
}

table <- profile()
lines <- markdown(
  list(part = table$part, microseconds = sprintf("%.0f", table$microseconds)), "microseconds"
)
cat(lines, sep = "\n")
table$microseconds <- signif(table$microseconds, 3L)
utils::write.csv(table, "vignettes/articles/bench-profile.csv", row.names = FALSE)
