# Learning from logged steps: compares batch Q-learning with a plain Python loop and a NumPy table,
# in rows per CPU second, and measures the CPU time of other methods.

data_names <- c(
  gym = "gym, learn_q(data)", python = "Python, NumPy table", lm = "gym, learn_fitted_q(), lm",
  rpart = "gym, learn_fitted_q(), rpart", wis = "gym, evaluate_offline(), wis",
  dr = "gym, evaluate_offline(), dr"
)

logged_rows <- function(rows = 1e5, states = 500L) {
  set.seed(1)
  data.frame(
    episode = (seq_len(rows) - 1L) %/% 10L, state = sample(0:(states - 1L), rows, TRUE),
    x = stats::rnorm(rows), group = sample(c("a", "b", "c"), rows, TRUE),
    action = sample(0:5, rows, TRUE), reward = stats::rnorm(rows), probability = 1 / 6
  )
}

compare_data <- function(python, turns, sweeps = 100L, python_sweeps = 2L) {
  loop <- start_worker(python, "tools/bench/batch_q.py")
  on.exit(end_worker(loop))
  data <- logged_rows()
  table <- steps_data(data, state = "state", probability = "probability")
  covariates <- steps_data(data, state = c("x", "group"), probability = "probability")
  some <- function(states) {
    rows <- data$episode < 2000
    steps_data(data[rows, ], state = states, probability = "probability")
  }
  file <- tempfile(fileext = ".csv")
  after <- ifelse(is.na(table$next_state), -1, table$next_state)
  utils::write.csv(data.frame(table[c("state", "action", "reward")], after), file)
  seconds <- function(code) sum(system.time(code)[1:2])
  often_0 <- function(states) matrix(c(0.5, rep(0.1, 5L)), nrow(states), 6L, byrow = TRUE)
  tasks <- list(
    gym = function() learn_q(table, discount = 0.99, iterations = sweeps),
    lm = function() learn_fitted_q(covariates, ~ action * x * group, iterations = 20),
    rpart = function() {
      grow <- function(formula, data) rpart::rpart(formula, data, xval = 0)
      learn_fitted_q(covariates, model = grow, discount = 0.9, iterations = 20)
    },
    wis = function() evaluate_offline(some("group"), often_0, "wis", seed = 1),
    dr = function() evaluate_offline(some("group"), often_0, "dr", seed = 1)
  )
  rows <- lapply(seq_len(turns), function(turn) {
    progress("data, turn ", turn, " of ", turns)
    took <- vapply(tasks, function(task) seconds(suppressWarnings(task())), 0)
    told <- ask(loop, sprintf("{\"file\": \"%s\", \"sweeps\": %d, \"discount\": 0.99}", file,
                              python_sweeps))
    rate <- nrow(data) * c(sweeps / took[["gym"]], python_sweeps / told$seconds)
    rbind(
      measured("data", 0, data_names[c("gym", "python")], "", turn, rate, "rows/s", "logged steps"),
      measured("data", 0, data_names[names(tasks)[-1L]], "", turn, took[-1L], "processor s",
               "logged steps")
    )
  })
  do.call(rbind, rows)
}

data_goals <- function(rows) {
  of <- function(name, unit = "processor s") {
    values_of(rows, "data", data_names[[name]], unit = unit)
  }
  within <- function(name, text, seconds) {
    goal(paste0(text, ": within ", seconds, " s"), stats::median(of(name)), at_most = seconds)
  }
  list(
    goal("batch Q-learning from 100,000 rows: at least 20 times Python's loop with a table",
         stats::median(of("gym", "rows/s") / of("python", "rows/s")), at_least = 20),
    within("lm", "100,000 rows, 20 iterations of fitted Q by lm with interactions", 5),
    within("rpart", "100,000 rows, 20 iterations of fitted Q by rpart", 60),
    within("wis", "1,000 replicates of wis, 2,000 episodes", 2),
    within("dr", "1,000 replicates of dr, 2,000 episodes", 2)
  )
}
