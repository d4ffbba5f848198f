# Environments that need no server, for tests of play and pictures. They have the methods that
# rollout() uses, and record their calls.

discrete_space <- function(n = 2L, start = 0L) {
  new_space(list(name = "Discrete", n = n, start = start, dtype = "int64"))
}

box_space <- function(low, high, shape = length(low), dtype = "float32") {
  new_space(list(
    name = "Box", shape = as.list(shape), dtype = dtype, low = as.list(low), high = as.list(high)
  ))
}

named_space <- function(space, id) {
  space$names <- observation_names(id, space)
  space
}

# `reward` and `ends` are functions of seed, step and action. Observations depend on
# seed and step alone. Their space has the names of the environment with this `id`.
fake_environment <- function(reward = function(seed, step, action) 1,
                             ends = function(seed, step, action) step == 3L,
                             observation_space = box_space(rep(-1, 4), rep(1, 4)),
                             action_space = discrete_space(2L),
                             reward_threshold = NULL, id = "Fake-v0") {
  observation_space <- named_space(observation_space, id)
  env <- new.env()
  env$spec <- list(id = id, reward_threshold = reward_threshold, max_episode_steps = NULL)
  env$observation_space <- observation_space
  env$action_space <- action_space
  env$seeds <- integer()
  env$actions <- list()
  env$closed <- 0L
  observe <- function() fake_observation(observation_space, env$seed, env$at)
  env$reset <- function(seed = NULL, options = NULL) {
    env$seed <- seed
    env$seeds <- c(env$seeds, seed)
    env$at <- 0L
    observe()
  }
  env$step <- function(action) {
    env$at <- env$at + 1L
    env$actions <- c(env$actions, list(action))
    ended <- ends(env$seed, env$at, action)
    list(
      observation = observe(), reward = reward(env$seed, env$at, action), done = ended,
      info = list(), terminated = ended, truncated = FALSE
    )
  }
  env$close <- function() {
    env$closed <- env$closed + 1L
    invisible(env)
  }
  env
}

fake_observation <- function(space, seed, at) {
  if (inherits(space, "gym_space_discrete")) {
    return(as.integer(space$start + (seed + at) %% space$n))
  }
  values <- sin(seed %% 1000 + at + seq_len(prod(space$shape)))
  if (length(space$shape) > 1L) array(values, space$shape) else values
}

# The same as a vector environment. It is as strict as the server. With "vector_entry_point" all are
# reset and stepped together, and the seed of a sub-environment follows from the one seed and its
# number. Otherwise each has its own seed, and `mask` and `which` choose some. In mode "SameStep", a
# sub-environment with several seeds begins its next episodes by itself. After the end of an
# episode, modes "Disabled" and "SameStep" accept no step until another episode has begun.
# `messages` counts resets and steps.
fake_vector_env <- function(num_envs, mode = "sync",
                            autoreset = if (mode == "sync") "Disabled" else "NextStep",
                            reward = function(seed, step, action) 1,
                            ends = function(seed, step, action) step == 3L,
                            observation_space = box_space(rep(-1, 4), rep(1, 4)),
                            action_space = discrete_space(2L),
                            reward_threshold = NULL, id = "Fake-v0") {
  observation_space <- named_space(observation_space, id)
  together <- mode == "vector_entry_point"
  all <- seq_len(num_envs)
  env <- new.env()
  env$spec <- list(id = id, reward_threshold = reward_threshold, max_episode_steps = NULL)
  env$num_envs <- as.integer(num_envs)
  env$vectorization_mode <- mode
  env$num_workers <- switch(mode, sync = 0L, async = 2L)
  env$autoreset_mode <- autoreset
  env$single_observation_space <- observation_space
  env$single_action_space <- action_space
  env$resets <- list()
  env$sub_env_steps <- 0L
  env$messages <- 0L
  env$closed <- 0L
  env$seed <- rep(NA_integer_, num_envs)
  env$at <- integer(num_envs)
  env$done <- logical(num_envs)
  env$later <- vector("list", num_envs)
  observe <- function(sub_envs) {
    batch_of(observation_space, lapply(sub_envs, function(i) {
      fake_observation(observation_space, env$seed[[i]], env$at[[i]])
    }))
  }
  env$reset <- function(seed = NULL, options = NULL, mask = NULL) {
    stopifnot(length(seed) == if (together) 1L else num_envs, is.null(mask) || !together)
    stopifnot(!is.list(seed) || autoreset == "SameStep")
    env$messages <- env$messages + 1L
    env$resets <- c(env$resets, list(seed))
    some <- if (is.null(mask)) all else which(mask)
    if (together) seed <- seed %% 1e8 + 17L * all
    env$seed[some] <- vapply(seed[some], function(each) as.numeric(each[[1L]]), 0)
    env$later[some] <- lapply(seed[some], function(each) each[-1L])
    env$at[some] <- 0L
    env$done[some] <- FALSE
    observe(all)
  }
  env$step <- function(action, which = NULL) {
    stopifnot(is.null(which) || !together)
    sub_envs <- which %||% all
    stopifnot(autoreset == "NextStep" || !any(env$done[sub_envs]))
    stopifnot(batch_length(action_space, action) == length(sub_envs))
    env$messages <- env$messages + 1L
    env$sub_env_steps <- env$sub_env_steps + length(sub_envs)
    again <- env$done[sub_envs]
    env$at[sub_envs] <- ifelse(again, 0L, env$at[sub_envs] + 1L)
    actions <- lapply(seq_along(sub_envs), batch_value, space = action_space, batch = action)
    each <- function(f) mapply(f, env$seed[sub_envs], env$at[sub_envs], actions)
    reward <- ifelse(again, 0, each(reward))
    ended <- each(ends) & !again
    env$done[sub_envs] <- ended
    next_observation <- observe(sub_envs)
    for (i in sub_envs[ended & lengths(env$later[sub_envs]) > 0L]) {
      env$seed[[i]] <- env$later[[i]][[1L]]
      env$later[[i]] <- env$later[[i]][-1L]
      env$at[[i]] <- 0L
      env$done[[i]] <- FALSE
    }
    list(
      observation = observe(sub_envs), reward = reward, done = ended, info = list(),
      terminated = ended, truncated = logical(length(sub_envs)),
      next_observation = next_observation
    )
  }
  env$close <- function() {
    env$closed <- env$closed + 1L
    invisible(env)
  }
  env
}

# Makes episodes of one step each, with these returns in the order of play.
scripted_environment <- function(returns, ...) {
  at <- 0L
  fake_environment(
    reward = function(seed, step, action) {
      at <<- at + 1L
      returns[[at]]
    },
    ends = function(seed, step, action) TRUE,
    ...
  )
}

# Makes a vector environment whose episodes have these returns and lengths, in the order of their
# numbers, batch after batch. Each batch has as many episodes as possible. The last step pays the
# return.
scripted_vector_env <- function(num_envs, returns, lengths, mode = "sync", ...) {
  batch <- -1L
  room <- num_envs * if (mode == "vector_entry_point") 1L else 4L
  seeds <- NULL
  at <- function(seed) batch * room + match(seed, seeds)
  env <- fake_vector_env(
    num_envs, mode, if (mode == "vector_entry_point") "NextStep" else "SameStep",
    reward = function(seed, step, action) {
      if (step == lengths[[at(seed)]]) returns[[at(seed)]] else 0
    },
    ends = function(seed, step, action) step == lengths[[at(seed)]],
    ...
  )
  reset <- env$reset
  env$reset <- function(seed = NULL, options = NULL, mask = NULL) {
    observation <- reset(seed, options, mask)
    batch <<- batch + 1L
    # Sub-environment i plays the episodes i, i + num_envs and so on.
    own <- function(seeds) as.numeric(seeds)[1:4]
    seeds <<- if (is.list(seed)) c(t(vapply(seed, own, numeric(4L)))) else env$seed
    observation
  }
  # In some modes, sub-environments beyond the last episode play, too.
  beyond <- 10L * num_envs
  returns <- c(returns, numeric(beyond))
  lengths <- c(lengths, rep(1L, beyond))
  env
}

# A reward that depends on the weights and on the seed.
first_action <- function(seed, step, action) if (step == 1L) 10 * action + seed %% 5 else 0

# For the argument `client`: a function that evaluates it is about to make something, and fails.
no_client <- function() stop("something was about to be made")
