# Compares PPO in R with Stable-Baselines3, turn by turn, each with one seed: the CPU seconds of a
# step, and those until the last 100 episodes of a training reach a mean return. Both have the same
# settings, and so the same updates per step.
#
# Optional, because torch is large. GYM_SB3_PYTHON names a Python that has it:
#
#   python3 -m venv sb3 && sb3/bin/pip install stable-baselines3 'gymnasium[box2d]'
#   GYM_SB3_PYTHON=sb3/bin/python make bench PARTS=gradients
#
# All of it takes hours. To measure only one environment, give its id among PARTS. turns=N and
# seeds=N measure less. Rows that are not measured again stay in the file, and rows with R's
# reference BLAS stay beside those with OpenBLAS (LD_PRELOAD=/usr/lib/.../libopenblas.so.0 selects
# it).
#
#   GYM_SB3_PYTHON=sb3/bin/python make bench PARTS='gradients LunarLander-v3 turns=5 seeds=0'

gradient_names <- c(gym = "gym, learn_ppo()", sb3 = "Stable-Baselines3, PPO")

# The settings of rl-baselines3-zoo (hyperparams/ppo.yml), but half as many rows for LunarLander,
# because with 16,384 most trainings of both failed. `target` is the mean return of 100 episodes. A
# training has failed if it does not reach it in `cap` steps.
gradient_tasks <- list(
  "CartPole-v1" = list(
    num_envs = 8, rows = 256, batch = 256, epochs = 20, discount = 0.98, lambda = 0.8,
    learning_rate = 1e-3, clip = 0.2, linear = TRUE, entropy = 0, target = 475, cap = 1e5
  ),
  "LunarLander-v3" = list(
    num_envs = 16, rows = 8192, batch = 64, epochs = 4, discount = 0.999, lambda = 0.98,
    learning_rate = 3e-4, clip = 0.2, linear = FALSE, entropy = 0.01, target = 200, cap = 1e6
  )
)

# JSON has no infinity.
out_of_reach <- 1e9

# This many steps of each are timed, enough for an update of LunarLander.
timed_steps <- c("CartPole-v1" = 10000, "LunarLander-v3" = 33000)

# The environments, turns and seeds that the arguments choose.
chosen_scale <- function(arguments) {
  number <- function(name) {
    given <- grep(paste0("^", name, "="), arguments, value = TRUE)
    if (length(given)) as.integer(sub(".*=", "", given))
  }
  of_each <- function(count) lapply(gradient_tasks, function(task) count)
  only <- intersect(names(gradient_tasks), arguments)
  chosen <- list(
    gradient_only = if (length(only)) only else names(gradient_tasks),
    gradient_turns = if (!is.null(number("turns"))) of_each(number("turns")),
    gradient_seeds = if (!is.null(number("seeds"))) of_each(number("seeds"))
  )
  Filter(Negate(is.null), chosen)
}

# The rows of earlier runs that are not measured again.
with_earlier <- function(rows, file) {
  what <- function(rows) paste(rows$env_id, rows$unit)
  earlier <- if (file.exists(file)) read_results(file)$rows
  rows <- rbind(earlier[!what(earlier) %in% what(rows), ], rows)
  rows[order(rows$env_id, rows$unit, method = "radix"), ]
}

# Unless another BLAS was chosen, R multiplies matrices by its own, which is slower.
gradient_label <- function(env_id) {
  if (grepl("openblas", name_of_blas(), ignore.case = TRUE)) env_id else paste0(env_id, reference)
}

reference <- ", reference BLAS"

start_sb3 <- function() {
  if (!nzchar(Sys.getenv("GYM_SB3_PYTHON"))) {
    stop("Name a Python that has Stable-Baselines3: see tools/bench/gradients.R.", call. = FALSE)
  }
  start_worker(Sys.getenv("GYM_SB3_PYTHON"), "tools/bench/sb3.py")
}

sb3_versions <- function() {
  worker <- start_sb3()
  on.exit(end_worker(worker))
  unlist(ask(worker, "\"versions\""))
}

compare_gradients <- function(python, scale) {
  # Each uses one thread. The worker sets this for torch.
  client <- gym_server_start(python = python, token = FALSE)
  worker <- start_sb3()
  on.exit({
    end_worker(worker)
    gym_server_stop(client)
  })
  contenders <- list(
    gym = function(task) train_here(client, task), sb3 = function(task) train_there(worker, task)
  )
  for (train in contenders) train(timed_task("CartPole-v1", 0L, 2000))
  rbind(
    play_gradients(
      contenders, scale$gradient_only, scale$gradient_turns, "a step", function(env_id, seed) {
        timed_task(env_id, seed, timed_steps[[env_id]])
      }, function(took) measured_cpu(took$seconds / took$steps * 1e6, "microseconds")
    ),
    play_gradients(
      contenders, scale$gradient_only, scale$gradient_seeds, "until the target", gradient_task,
      function(took) measured_cpu(if (took$reached) took$seconds else Inf, "s")
    )
  )
}

measured_cpu <- function(value, unit) list(value = value, unit = unit)

gradient_task <- function(env_id, seed, ...) {
  task <- gradient_tasks[[env_id]]
  utils::modifyList(c(task, list(env_id = env_id, seed = seed, total_steps = task$cap)), list(...))
}

# Trains for so many steps, without a target.
timed_task <- function(env_id, seed, steps) {
  gradient_task(env_id, seed, target = out_of_reach, total_steps = steps)
}

# `turns` has a number for each environment.
play_gradients <- function(contenders, only, turns, called, task_of, measure) {
  do.call(rbind, lapply(intersect(names(turns), only), function(env_id) {
    do.call(rbind, lapply(seq_len(turns[[env_id]]), function(turn) {
      progress(env_id, ", PPO, ", called, ", turn ", turn, " of ", turns[[env_id]])
      order <- if (turn %% 2L) names(contenders) else rev(names(contenders))
      do.call(rbind, lapply(order, function(name) {
        one <- measure(contenders[[name]](task_of(env_id, 1000L + turn)))
        measured("gradients", 0, gradient_names[[name]], called, turn, one$value, one$unit,
                 gradient_label(env_id))
      }))
    }))
  }))
}

train_there <- function(worker, task) {
  ask(worker, jsonlite::toJSON(task, auto_unbox = TRUE, digits = NA))
}

# The mean return of the last iterations that have at least 100 episodes.
last_hundred <- function(history) {
  episodes <- round(diff(c(0, history$steps)) / history$mean_length)
  later <- rev(cumsum(rev(episodes))) - episodes
  last <- later < 100
  if (sum(episodes) < 100) -Inf else stats::weighted.mean(history$mean_return[last], episodes[last])
}

train_here <- function(client, task) {
  changes <- function(from) {
    if (task$linear) schedule_linear(from, 0, task$cap) else from
  }
  agent <- agent_ppo(
    batch_steps = task$rows, batch = task$batch, epochs = task$epochs, gamma = task$discount,
    lambda = task$lambda, learning_rate = changes(task$learning_rate), clip = changes(task$clip),
    entropy = task$entropy
  )
  server <- server_pid(client)
  used <- function() cpu_seconds(c(Sys.getpid(), server, descendants(server)))
  before <- used()
  training <- train_agent(
    agent, task$env_id, total_steps = task$total_steps, seed = task$seed, target = Inf,
    eval_every = 1e6, eval_episodes = 2, client = client, progress = FALSE,
    callback = function(training) last_hundred(training$history) < task$target
  )
  list(
    seconds = used() - before, steps = training$steps,
    reached = last_hundred(training$history) >= task$target
  )
}
