# Learns with the installed gym, which may be an older one. Reads the names of tasks and answers
# each line with the steps, the CPU seconds of R and the server, and the seconds that passed, as
# JSON.
suppressMessages(library(gym))
source("tools/bench/cpu.R")

on_server <- if ("model" %in% names(formals(train_agent))) list(model = FALSE)
learn_taxi <- function(episodes, ...) {
  learn_q("Taxi-v4", iterations = 1, episodes = episodes, target = Inf, eval_episodes = 2, ...)
}

learner_tasks <- list(
  "Taxi-v4" = function() learn_taxi(3000),
  "FrozenLake8x8-v1" = function() {
    learn_q("FrozenLake8x8-v1", iterations = 1, episodes = 3000, target = Inf, eval_episodes = 2)
  },
  server = function() do.call(learn_taxi, c(list(600, num_envs = 32, num_workers = 0), on_server)),
  tiles = function() {
    learn_sarsa("MountainCar-v0", iterations = 10, discount = 1, features = tile_coding(8, 8),
                lambda = 0.9, epsilon = 0, learning_rate = 0.3, target = Inf, eval_every = 100,
                eval_episodes = 2)
  },
  blackjack = function() {
    learn_monte_carlo("Blackjack-v1", iterations = 500, episodes = 1000, discount = 1, sab = TRUE,
                      target = Inf, eval_every = 1000)
  }
)

server <- server_pid(gym_client())
used <- function() cpu_seconds(c(Sys.getpid(), server, descendants(server)))
input <- file("stdin", "r")
while (length(name <- readLines(input, 1L))) {
  # The first call gets the model and compiles code, so it is not timed.
  set.seed(1)
  before <- used()
  passed <- system.time(learned <- suppressMessages(learner_tasks[[name]]()))[["elapsed"]]
  cat(jsonlite::toJSON(list(
    steps = learned$steps, seconds = used() - before, passed = passed
  ), auto_unbox = TRUE, digits = NA), "\n", sep = "")
}
