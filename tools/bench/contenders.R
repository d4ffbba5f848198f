# The contenders in steps a second. Each has a name, a way to call it, and a function that plays a
# turn. Environments are made at the start and kept for all turns.

contender <- function(part, num_envs, name, called, play) {
  list(part = part, num_envs = num_envs, name = name, called = called, play = play)
}

# The names of reticulate with the server's NumPy, and with a NumPy that it converts.
reticulate_name <- function(worker) {
  paste0("reticulate, NumPy ", sub("[.].*", "", ask(worker, "versions")$NumPy))
}

single_contenders <- function(setup) {
  client <- setup$client
  id <- env_create(client, "CartPole-v1", seed = 1)
  env <- gym_make("CartPole-v1", seed = 1, client = client)
  classic <- setup$development$url
  classic_id <- classic_create(classic, "CartPole-v1")
  c(
    list(
      contender("single", 0, "gym, env_step()", "env_step(client, id, a)", function(seconds) {
        play_single(
          function() env_reset(client, id), function(a) env_step(client, id, a)$done, seconds
        )
      }),
      contender("single", 0, "gym, env$step()", "env$step(a)", function(seconds) {
        play_single(env$reset, function(a) env$step(a)$done, seconds)
      }),
      contender("single", 0, "classic pattern", "httr::POST() for each call", function(seconds) {
        play_single(
          function() classic_reset(classic, classic_id),
          function(a) classic_step(classic, classic_id, a)$done,
          seconds
        )
      }),
      contender("single", 0, "Python", "env.step(a) in a loop", function(seconds) {
        ask(setup$python, "single", seconds)
      })
    ),
    unlist(lapply(setup$reticulate, reticulate_single), recursive = FALSE)
  )
}

# Both ways to call it are contenders of their own.
reticulate_single <- function(worker) {
  forms <- ask(worker, "forms single")
  lapply(seq_along(forms), function(form) {
    name <- paste0(reticulate_name(worker), if (form > 1L) ", step kept")
    contender("single", 0, name, forms[[form]], function(seconds) {
      ask(worker, "single", form, seconds)
    })
  })
}

vector_contenders <- function(setup, num_envs) {
  env <- gym_make("CartPole-v1", num_envs = num_envs, seed = 1, client = setup$client)
  env$reset()
  actions <- alternating(num_envs)
  mode <- env$vectorization_mode
  c(
    list(
      contender("vector", num_envs, own[["vector"]], paste("env$step(a),", mode), function(s) {
        play_vector(num_envs, actions, env$step, s)
      }),
      contender("vector", num_envs, "Python", paste0("envs.step(a), ", mode), function(seconds) {
        ask(setup$python, "vector", seconds, num_envs, mode)
      })
    ),
    lapply(setup$reticulate, reticulate_vector, num_envs, mode)
  )
}

# Finds the fastest way to call it: the best of some tries, in which the ways take turns.
reticulate_vector <- function(worker, num_envs, mode) {
  forms <- ask(worker, "forms vector")
  tries <- replicate(5L, vapply(seq_along(forms), function(form) {
    ask(worker, "vector", form, 0.1, num_envs, mode)
  }, 0))
  best <- which.max(apply(tries, 1L, max))
  contender("vector", num_envs, reticulate_name(worker), forms[[best]], function(seconds) {
    ask(worker, "vector", best, seconds, num_envs, mode)
  })
}

# In each turn all contenders play. Every second turn has the opposite order.
play_turns <- function(contenders, turns, seconds) {
  for (contender in contenders) contender$play(seconds / 4)
  orders <- lapply(seq_len(turns), function(turn) {
    if (turn %% 2L) seq_along(contenders) else rev(seq_along(contenders))
  })
  rows <- lapply(seq_len(turns), function(turn) {
    progress("turn ", turn, " of ", turns, ": ", length(contenders), " contenders")
    do.call(rbind, lapply(contenders[orders[[turn]]], function(one) {
      measured(one$part, one$num_envs, one$name, one$called, turn, one$play(seconds), "steps/s")
    }))
  })
  do.call(rbind, rows)
}
