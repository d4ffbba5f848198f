# The vector environment in which episodes are played, the same for every kind of environment: it
# has spaces, says how many episodes make a batch, and is reset and stepped with rows, one for each
# sub-environment that is playing. See vector_env_of().

# How many sub-environments an environment gets that is made from its id, and so how many episodes
# make a batch. These numbers must not depend on how many episodes are asked for, because the seeds
# and weights that are drawn for an episode would then depend on it, too.
entry_point_sub_envs <- 256L
sync_sub_envs <- 16L

#' Call a function with the vector environment of an environment
#'
#' An environment that is named by its id is made first, and closed when `use` has returned.
#' @param episodes How many episodes are played at most: no more sub-environments are made.
#' @param use A function of the vector environment.
#' @param frames Whether frames are kept: then the environment is made without sub-environments.
#' @param make A function of the id, `episodes` and the client, which makes the environment.
#' @param batch_size As for [vector_env_of()], of an environment that is made here.
#' @noRd
with_vector_env <- function(env, episodes, client, use, frames = FALSE, make = make_vector_env,
                            batch_size = sync_sub_envs) {
  call <- rlang::caller_env()
  if (!is.character(env) && !inherits(env, "gym_wrapped")) {
    return(use(vector_env_of(env, call = call, frames = frames)))
  }
  env <- if (frames) gym_make(env, client = client) else make(env, episodes, client)
  finished <- FALSE
  # When playing was interrupted because the server hangs, closing must not wait for it again.
  on.exit(
    if (finished) close_or_warn(env) else close_unused(env$client, env$instance_id)
  )
  value <- use(vector_env_of(env, batch_size, call, frames))
  finished <- TRUE
  value
}

# What was played is not lost because the environment could not be closed.
close_or_warn <- function(env) {
  tryCatch(
    env$close(),
    gym_error = function(cnd) {
      rlang::warn(
        c("The environment could not be closed.", x = conditionMessage(cnd)),
        class = "gym_warning_close"
      )
    }
  )
}

make_vector_env <- function(env_id, episodes, client) {
  own <- if (has_vector_implementation(env_id, client)) {
    make_if_supported(env_id, entry_point_sub_envs, "vector_entry_point", NULL, client)
  }
  own %||% make_if_supported(env_id, min(episodes, sync_sub_envs), "sync", "Disabled", client) %||%
    gym_make(env_id, client = client)
}

# Does the server choose the environment's own vector implementation where it may choose? The
# question is asked with one sub-environment, because making many takes long.
has_vector_implementation <- function(env_id, client) {
  sub_env <- make_if_supported(env_id, 1L, NULL, NULL, client)
  if (is.null(sub_env)) {
    return(FALSE)
  }
  on.exit(close_quietly(sub_env))
  identical(sub_env$vectorization_mode, "vector_entry_point")
}

# The codes of errors that an environment with fewer sub-environments, or with none, may not have.
fewer_sub_envs_codes <- c(
  "not_supported", "too_many_sub_envs", "too_much_memory", "unsupported_space"
)

# Makes the environment, or returns NULL where the server cannot make such sub-environments, or not
# that many.
make_if_supported <- function(env_id, num_envs, vectorization_mode, autoreset_mode, client) {
  tryCatch(
    gym_make(
      env_id, num_envs = num_envs, vectorization_mode = vectorization_mode,
      autoreset_mode = autoreset_mode, client = client
    ),
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% fewer_sub_envs_codes)) {
        rlang::cnd_signal(cnd)
      }
    }
  )
}

#' Describe an environment as a vector environment
#'
#' @param batch_size How many episodes make a batch where each sub-environment has a seed of its
#'   own; `NULL` for as many as there are sub-environments.
#' @param frames Whether frames are kept.
#' @return A list:
#'   * `observation_space`, `action_space`: those of a single sub-environment,
#'   * `spec`, `client`: as an environment has them, for [policy_bind()],
#'   * `call`: the call that errors name while episodes are played,
#'   * `batch_size`: how many episodes are played at once,
#'   * `num_envs`: how many sub-environments share one seed; `NULL` where each has its own,
#'   * `draw_seeds()`: draws the seeds of a batch, one for each episode,
#'   * `reset(seeds)`: returns the observations of all sub-environments,
#'   * `step(action, playing)`: steps the sub-environments with the numbers `playing`; `action` and
#'     what is returned have a row for each of these,
#'   * `frame()`: returns the current frame as the bytes of a PNG file; `NULL` where no frames are
#'     kept.
#' @noRd
vector_env_of <- function(env, batch_size = NULL, call = rlang::caller_env(), frames = FALSE) {
  if (is.null(env$num_envs)) {
    vector_env <- single_env(env, call)
  } else if (identical(env$vectorization_mode, "sync")) {
    vector_env <- independent_sub_envs(env, batch_size %||% env$num_envs, call)
  } else {
    check_ended_can_step(env, call)
    vector_env <- joint_sub_envs(env, call)
  }
  vector_env$spec <- env$spec
  vector_env$client <- env$client
  vector_env$call <- call
  if (frames) {
    check_draws(env, call)
    vector_env$frame <- function() png_frame(env$client, env$instance_id, call)
  }
  vector_env
}

# An environment without sub-environments plays one episode after the other.
single_env <- function(env, call) {
  observed <- env$observation_space
  actions <- env$action_space
  list(
    observation_space = observed, action_space = actions, batch_size = 1L,
    draw_seeds = function() draw_environment_seeds(1L),
    reset = function(seeds) batch_of(observed, list(env$reset(seed = seeds))),
    step = function(action, playing) {
      out <- take_step(env, 1L, call, batch_value(actions, action, 1L))
      out$observation <- batch_of(observed, list(out$observation))
      out
    }
  )
}

# With "sync", each sub-environment is an environment of its own: it has a seed of its own, and only
# those that are playing are stepped.
independent_sub_envs <- function(env, batch_size, call) {
  n <- env$num_envs
  list(
    observation_space = env$single_observation_space,
    action_space = env$single_action_space, batch_size = batch_size,
    draw_seeds = function() draw_environment_seeds(batch_size),
    reset = function(seeds) env$reset(seed = seeds[seq_len(n)]),
    step = function(action, playing) {
      if (length(playing) == n) {
        take_step(env, n, call, action)
      } else {
        take_step(env, length(playing), call, action, which = playing)
      }
    }
  )
}

# With "vector_entry_point" and "async", all sub-environments are always stepped, also those whose
# episode has ended; what these return is left out. With "vector_entry_point" one generator serves
# all sub-environments, so there is one seed for all.
joint_sub_envs <- function(env, call) {
  n <- env$num_envs
  observed <- env$single_observation_space
  actions <- env$single_action_space
  one_seed <- !identical(env$vectorization_mode, "async")
  list(
    observation_space = observed, action_space = actions, batch_size = n,
    num_envs = if (one_seed) n,
    draw_seeds = function() rep_len(draw_environment_seeds(if (one_seed) 1L else n), n),
    reset = function(seeds) env$reset(seed = if (one_seed) seeds[[1L]] else seeds),
    step = function(action, playing) {
      if (length(playing) == n) {
        return(take_step(env, n, call, action))
      }
      # Those that have ended repeat the action of the first that is playing.
      row <- rep(1L, n)
      row[playing] <- seq_along(playing)
      out <- take_step(env, n, call, batch_rows(actions, action, row))
      list(
        observation = batch_rows(observed, out$observation, playing),
        reward = out$reward[playing],
        terminated = out$terminated[playing],
        truncated = out$truncated[playing]
      )
    }
  )
}

# `max_steps` cannot lift the environment's own limit.
warn_of_own_limit <- function(max_steps, vector_env, call) {
  own <- vector_env$spec$max_episode_steps
  if (!is.null(max_steps) && !is.null(own) && own < max_steps) {
    wanted <- format(max_steps, scientific = FALSE)
    id <- environment_label(vector_env)
    rlang::warn(
      c(paste0("`max_steps = ", wanted, "` makes no episode longer: ", id,
               " has a limit of its own, ", count_of(own, "step"), "."),
        i = paste0("`max_episode_steps = ", wanted, "` as a further argument of `gym_make()` ",
                   "sets another limit; a TimeLimit wrapper can only lower it.")),
      class = "gym_warning_max_steps", call = call
    )
  }
}

check_ended_can_step <- function(env, call) {
  if (identical(env$autoreset_mode, "Disabled")) {
    gym_abort(
      c(
        paste0("Episodes of different length cannot be played in ", environment_label(env),
               " made with vectorization_mode \"", env$vectorization_mode,
               "\" and autoreset_mode \"Disabled\": all of its sub-environments are stepped ",
               "together, and one that has ended takes no step."),
        i = "Make it with autoreset_mode \"NextStep\", or with vectorization_mode \"sync\"."
      ),
      class = "gym_error_argument", argument = "env", value = env, call = call
    )
  }
}
