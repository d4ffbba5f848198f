# Compares whole episodes by rollout(), with an environment given by its id, with Python's own loop
# over one environment and with reticulate. All may use two cores.

rollout_cores <- 2L

rollout_names <- c(
  gym = "gym, rollout()",
  python = "Python",
  network = "gym, rollout() through a network of 20 ms",
  balancing = "gym, rollout(), a network that balances",
  search = "gym, search_random()",
  preset = "gym, train_agent(), LunarLander's preset",
  memory = "server and processes, above an idle server"
)

# Evaluates code while this process, and all that it starts, may use these cores only. If the system
# has no such limit, all cores are used.
on_cores <- function(count, code) {
  allowed <- parallel::mcaffinity()
  if (length(allowed) > count) {
    parallel::mcaffinity(allowed[seq_len(count)])
    on.exit(parallel::mcaffinity(allowed))
  }
  force(code)
}

# How many cores may be used.
count_cores <- function() {
  allowed <- length(parallel::mcaffinity())
  if (allowed) min(allowed, rollout_cores) else parallel::detectCores()
}

compare_rollouts <- function(python, turns, quick) {
  on_cores(rollout_cores, {
    setup <- start_contenders(python)
    on.exit(stop_contenders(setup))
    rbind(
      do.call(rbind, lapply(tasks, function(task) {
        episodes <- if (quick) task$quick else task$episodes
        play_paired(rollout_contenders(setup, task, episodes), turns, task$env_id)
      })),
      play_paired(candidate_contenders(setup, tasks[["LunarLander-v3"]]), turns, "16 candidates")
    )
  })
}

start_contenders <- function(python) {
  numpy_1 <- Filter(dir.exists, file.path(dirname(dirname(python)), "numpy-1"))
  list(
    client = gym_server_start(python = python),
    python = start_python(python),
    reticulate = lapply(c(list(NULL), numpy_1), start_reticulate, python = python)
  )
}

stop_contenders <- function(setup) {
  for (worker in c(list(setup$python), setup$reticulate)) end_worker(worker)
  gym_server_stop(setup$client)
}

# After a first try of each, all play in each turn. Every second turn has the opposite order.
# `play()` of a contender returns steps a second.
play_paired <- function(contenders, turns, what) {
  for (contender in contenders) contender$warm_up()
  do.call(rbind, lapply(seq_len(turns), function(turn) {
    progress(what, ", turn ", turn, " of ", turns)
    order <- if (turn %% 2L) contenders else rev(contenders)
    do.call(rbind, lapply(order, function(one) {
      measured(one$part, 0, one$name, one$called, turn, one$play(), "steps/s", one$env_id)
    }))
  }))
}

paired <- function(part, task, name, called, play, warm_up = play) {
  called <- sprintf("%s, %d cores", called, count_cores())
  list(
    part = part, env_id = task$env_id, name = name, called = called, play = play,
    warm_up = warm_up
  )
}

rollout_contenders <- function(setup, task, episodes) {
  policy <- task_policy(task)
  play <- function(...) play_by_id(task, policy, episodes, setup$client, ...)
  loop <- python_loop(setup$python, task, list(task_numbers(task)))
  c(
    list(
      paired("env_rollouts", task, rollout_names[["gym"]],
             sprintf("rollout(id, policy, %d)", episodes),
             function() rate_of(play),
             # Play as many episodes, so that all worker processes run, but short ones.
             function() play(max_steps = 2)),
      paired("env_rollouts", task, rollout_names[["python"]],
             sprintf("env.step(a) in a loop, %d episodes", episodes),
             function() loop(episodes), function() loop(2L))
    ),
    if (task$reticulate) lapply(setup$reticulate, reticulate_episodes, task)
  )
}

# `play()` gives how many steps it took.
rate_of <- function(play) {
  started <- now()
  steps <- play()
  steps / (now() - started)
}

play_by_id <- function(task, policy, episodes, client, max_steps = NULL) {
  env_id <- task$env_id
  played <- if (task$stack) {
    env_id |>
      gym_wrap("AtariPreprocessing") |>
      gym_wrap("FrameStackObservation", stack_size = 4) |>
      rollout(policy, episodes, max_steps, seed = 1, client = client, frameskip = 1)
  } else {
    rollout(env_id, policy, episodes, max_steps, seed = 1, client = client)
  }
  sum(played$episodes$length)
}

task_policy <- function(task, numbers = task_numbers(task)) {
  switch(task$kind,
    random = policy_random(),
    box = policy_network(c(task$inputs, task$outputs), "tanh", list(numbers)),
    policy_network(c(task$inputs, task$outputs), "identity", list(numbers))
  )
}

# The loop in Python, a function of the number of episodes with each of the policies.
python_loop <- function(worker, task, policies) {
  numbers <- do.call(rbind, policies)
  if (!is.matrix(policies[[1L]])) numbers <- policies[[1L]]
  file <- write_numbers(numbers)
  function(episodes) {
    ask(worker, "episodes", task$env_id, task$kind, file, task$outputs, length(policies), episodes)
  }
}

# How many sub-environments reticulate steps together, and for how long.
reticulate_episodes <- function(worker, task) {
  play <- function(seconds) ask(worker, "episodes", task$env_id, seconds, 32)
  paired("env_rollouts", task, reticulate_name(worker), "SyncVectorEnv, 32 sub-environments",
         function() play(2), function() play(0.1))
}

# An iteration of a search: 16 candidates, 2 episodes each. It is short, so a turn has several.
candidate_contenders <- function(setup, task, candidates = 16L, episodes = 2L, iterations = 10L) {
  numbers <- lapply(seq_len(candidates), function(seed) task_numbers(task, seed))
  weights <- do.call(rbind, lapply(numbers, function(one) coef(task_policy(task, one))))
  policies <- policy_candidates(task_policy(task), weights)
  loop <- python_loop(setup$python, task, numbers)
  called <- sprintf("%d candidates, %d episodes each", candidates, episodes)
  play <- function() {
    sum(vapply(seq_len(iterations), function(iteration) {
      played <- rollout(task$env_id, policies, episodes, seed = iteration, client = setup$client)
      sum(played$episodes$length)
    }, 0))
  }
  list(
    paired("candidates", task, rollout_names[["gym"]], called, function() rate_of(play)),
    # All iterations play the same steps, so their common rate is that of one.
    paired("candidates", task, rollout_names[["python"]], called, function() {
      mean(replicate(iterations, loop(episodes)))
    })
  )
}
