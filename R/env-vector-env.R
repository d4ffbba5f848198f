#' Construct a vector environment, the interface of everything that plays
#'
#' The arguments are its elements; [as_vector_env()] describes most of them. Functions that play add
#' `call`, the user's call, which errors name, and `recipe`, see [environment_recipe()]. Models add
#' `model`, `possible` and `endless`.
#' @param reset,step `NULL` only with `description`.
#' @param step_one If there is one sub-environment: a function of one action that returns a step.
#' @param guard For `step_one` of an environment in R: a function that evaluates many steps and says
#'   in which one the user's functions raised an error.
#' @param description What a server needs to play whole episodes itself, see [describe_env()]. The
#'   vector environment then also has `known`, the size of the last request, and `make_stepped()`,
#'   which makes the environment that R steps.
#' @noRd
new_vector_env <- function(observation_space, action_space, spec, num_envs, batch_size, one_seed,
                           reset = NULL, step = NULL, step_bare = NULL, begins_next = FALSE,
                           frame = NULL, remembers = character(), env = NULL, client = NULL,
                           close = function(wait = TRUE) invisible(), step_one = NULL,
                           guard = NULL, description = NULL) {
  structure(mget(names(formals())), class = "gym_vector_env")
}

# Environments as vector environments -------------------------------------------------

#' Convert an existing environment to a vector environment
#'
#' @param batch_size The number of episodes in a batch if each sub-environment has its own seed;
#'   `NULL` to derive it from the number of sub-environments.
#' @return As [as_vector_env()].
#' @noRd
vector_env_of <- function(env, frames = FALSE, batch_size = NULL, call = rlang::caller_env()) {
  parts <- if (is.null(env$num_envs)) {
    single_env(env)
  } else if (identical(env$vectorization_mode, "vector_entry_point")) {
    if (identical(env$autoreset_mode, "Disabled")) {
      abort_wrong("env", env, call,
                  "Episodes of different length cannot be played in {environment_label(env)} made
                   with vectorization_mode \"{env$vectorization_mode}\" and autoreset_mode
                   \"Disabled\": all of its sub-environments are stepped together, and one that has
                   ended takes no step.",
                  i = "Make it with autoreset_mode \"NextStep\", or with vectorization_mode
                       \"sync\".")
    }
    joint_sub_envs(env)
  } else {
    independent_sub_envs(env)
  }
  parts$batch_size <- if (parts$one_seed || is.null(env$num_envs)) {
    parts$num_envs
  } else {
    batch_size %||% episodes_of_batch(parts$num_envs)
  }
  if (frames) {
    check_draws(env, call)
    parts$frame <- function() png_frame(env$client, env$instance_id, call)
    # The next episode must not begin before the last frame of this one is drawn.
    parts$begins_next <- FALSE
  }
  rlang::exec(
    new_vector_env, !!!parts, spec = env$spec, remembers = remembering(env$spec$wrappers),
    env = env, client = env$client
  )
}

# The number of episodes in a batch for sub-environments with their own seeds. With four episodes
# for each, few sub-environments are idle while the last episodes end. A single sub-environment has
# one episode in a batch, so that an interrupt loses no finished episode.
episodes_of_batch <- function(num_envs) {
  as.integer(if (num_envs == 1L) 1L else 4L * num_envs)
}

# An environment without sub-environments plays one episode after the other.
single_env <- function(env) {
  observed <- env$observation_space
  actions <- env$action_space
  step_one <- function(action) {
    out <- take_step(env, 1L, action)
    out$observation <- out$next_observation <- batch_of(observed, list(out$observation))
    out
  }
  list(
    observation_space = observed, action_space = actions, num_envs = 1L, one_seed = FALSE,
    reset = function(seeds, which = 1L) batch_of(observed, list(first_observation(env, seeds))),
    step = function(action, which = 1L) step_one(batch_value(actions, action, 1L)),
    step_one = step_one
  )
}

# With "sync" and "async", each sub-environment has its own seed, and only those that play take a
# step. Only a server's environments have `num_workers`, so only these are relied on to start the
# next episode themselves.
independent_sub_envs <- function(env) {
  n <- env$num_envs
  space <- env$single_observation_space
  # The first reset is for all, because no sub-environment has an episode yet.
  was_reset <- FALSE
  reset <- function(seeds, which) {
    some <- was_reset && length(which) < n
    seed <- rep(if (some) NA_real_ else seeds, length.out = n)
    seed[which] <- seeds
    observation <- if (some) {
      first_observation(env, seed, mask = seq_len(n) %in% which)
    } else {
      first_observation(env, seed)
    }
    was_reset <<- TRUE
    batch_rows(space, observation, which)
  }
  step <- function(action, which) {
    out <- take_step(env, length(which), action, if (length(which) < n) which)
    out$next_observation <- out$next_observation %||% out$observation
    out
  }
  begins_next <- !is.null(env$num_workers) && identical(env$autoreset_mode, "SameStep")
  list(
    observation_space = space, action_space = env$single_action_space, num_envs = n,
    one_seed = FALSE, reset = reset, begins_next = begins_next, step = step,
    step_bare = if (begins_next && is_server_env(env)) bare_stepper(env)
  )
}

# Makes the function `step_bare()`. Sub-environments stop after their last episode, and each new set
# of them needs a new request, which takes time to prepare. So this steps the ones that have
# stopped, too, and ignores their results, until at most half of the set play.
bare_stepper <- function(env) {
  n <- env$num_envs
  actions <- env$single_action_space
  stepped <- NULL
  function(action, which) {
    row <- match(which, stepped)
    if (anyNA(row) || 2L * length(which) <= length(stepped)) {
      stepped <<- which
      row <- seq_along(which)
    }
    count <- length(stepped)
    along <- length(which) < count
    if (along) action <- actions_of_all(actions, action, row, count)
    out <- take_step(env, count, action, if (count < n) stepped, finals = FALSE)
    if (along) rows_of_step(env$single_observation_space, out, row) else out
  }
}

# Some rows of the result of a step.
rows_of_step <- function(space, out, row) {
  # Usually both are the same object, which identical() sees at once.
  same <- identical(out$observation, out$next_observation)
  observation <- batch_rows(space, out$observation, row)
  list(
    observation = observation, reward = out$reward[row], terminated = out$terminated[row],
    truncated = out$truncated[row],
    next_observation = if (same) observation else batch_rows(space, out$next_observation, row)
  )
}

# With "vector_entry_point", all sub-environments share one generator and one seed. Each step steps
# all of them; the results of those whose episode has ended are ignored.
joint_sub_envs <- function(env) {
  n <- env$num_envs
  observed <- env$single_observation_space
  actions <- env$single_action_space
  list(
    observation_space = observed, action_space = actions, num_envs = n, one_seed = TRUE,
    reset = function(seeds, which = NULL) first_observation(env, seeds),
    step = function(action, which) {
      out <- take_step(env, n, actions_of_all(actions, action, which, n))
      out$next_observation <- out$next_observation %||% out$observation
      if (length(which) < n) {
        return(rows_of_step(observed, out, which))
      }
      out[c("observation", "reward", "terminated", "truncated", "next_observation")]
    }
  )
}

# The actions of all sub-environments. Those whose episode has ended repeat the action of the first
# that plays.
actions_of_all <- function(space, action, which, n) {
  if (length(which) == n) {
    return(action)
  }
  row <- rep(1L, n)
  row[which] <- seq_along(which)
  batch_rows(space, action, row)
}
