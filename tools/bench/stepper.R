# A build of the package as a contender of the part "stream", in its own process, from the library
# that R_LIBS names first. Reads one line a turn and answers with one: microseconds a step, or
# seconds:
#
#   step ENV_ID NUM_ENVS STEPS    env$step(), NUM_ENVS 0 for a single environment
#   classic ENV_ID 0 STEPS        env_step()
#   rollout ENV_ID 0 EPISODES     rollout() with a function
#   learn ENV_ID 0 STEPS          learn_q() step by step

suppressMessages(library(gym))
client <- gym_server_start(python = Sys.getenv("GYM_PYTHON"))
made <- new.env()

prepared <- function(env_id, num_envs) {
  key <- paste(env_id, num_envs)
  if (is.null(made[[key]])) {
    env <- suppressWarnings(
      gym_make(env_id, num_envs = if (num_envs) num_envs, seed = 1, client = client)
    )
    spaces <- list(env$single_action_space, env$action_space)
    actions <- lapply(1:2, function(i) if (num_envs) rep_len(c(i, 3 - i) - 1, num_envs) else i - 1)
    if (!inherits(spaces[[1L]], "gym_space_discrete")) {
      actions <- lapply(1:2, function(i) space_sample(spaces[[2L]]))
    }
    made[[key]] <- list(env = env, actions = actions)
  }
  made[[key]]
}

# A block of steps begins with a reset, which is not timed.
time_blocks <- function(steps, reset, step) {
  took <- numeric()
  for (block in seq_len(ceiling(steps / 8))) {
    reset()
    started <- Sys.time()
    for (i in 1:8) step(1L + i %% 2L)
    took <- c(took, as.numeric(Sys.time() - started, units = "secs"))
  }
  1e6 * median(took) / 8
}

play <- list(
  step = function(env_id, num_envs, steps) {
    one <- prepared(env_id, num_envs)
    env <- one$env
    time_blocks(steps, function() env$reset(seed = 1), function(i) env$step(one$actions[[i]]))
  },
  classic = function(env_id, num_envs, steps) {
    one <- prepared(env_id, num_envs)
    id <- one$env$instance_id
    time_blocks(
      steps, function() env_reset(client, id, seed = 1),
      function(i) env_step(client, id, one$actions[[i]])
    )
  },
  rollout = function(env_id, num_envs, episodes) {
    policy <- function(o) as.integer(o[, 1] > 0)
    system.time(rollout(env_id, policy, episodes, seed = 1, client = client))[["elapsed"]]
  },
  learn = function(env_id, num_envs, steps) {
    system.time(suppressWarnings(learn_q(
      env_id, model = FALSE, num_envs = 1, total_steps = steps, seed = 1, client = client,
      episodes = 1, eval_episodes = 2
    )))[["elapsed"]]
  }
)

input <- file("stdin", "r")
while (length(line <- readLines(input, 1L))) {
  words <- strsplit(line, " ")[[1L]]
  numbers <- as.numeric(words[3:4])
  cat(play[[words[[1L]]]](words[[2L]], numbers[[1L]], numbers[[2L]]), "\n", sep = "")
}
gym_server_stop(client)
