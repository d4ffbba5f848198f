# What is played on: the sub-environments of an environment, whatever its kind. Each kind offers
# the same: its spaces, how many episodes it plays at once, and reset and step on rows,
# one for each sub-environment that plays.

# How many episodes a block has, where an environment is made for the purpose. They must
# not depend on how many episodes are asked for: which seeds and weights are drawn for
# an episode would depend on it, too.
entry_point_sub_envs <- 256L
sync_sub_envs <- 16L

#' Call a function with the sub-environments of an environment
#'
#' One that is named by its id is made first and closed when `use` is left.
#' @param episodes How many episodes are played at most: no more sub-environments are made.
#' @param frames Whether the sub-environments must draw: then there is a single one.
#' @param make,block Makes the sub-environments of one that is named, given its id, `episodes` and
#'   the client; how many episodes of these make a block, see [vector_env_of()].
#' @noRd
with_vector_env <- function(env, episodes, client, use, frames = FALSE, make = make_vector_env,
                       block = sync_sub_envs) {
  call <- rlang::caller_env()
  if (!is.character(env) && !inherits(env, "gym_wrapped")) {
    return(use(vector_env_of(env, call = call, frames = frames)))
  }
  env <- if (frames) gym_make(env, client = client) else make(env, episodes, client)
  finished <- FALSE
  # After a server that hung there must not be another wait.
  on.exit({
    if (finished) close_made(env, finished) else close_unused(env$client, env$instance_id)
  })
  value <- use(vector_env_of(env, block, call, frames))
  finished <- TRUE
  value
}

#' Ask what is observed and done in an environment
#'
#' One that is named by its id is made for the question and closed.
#' @return A list: `observation_space` and `action_space` of a sub-environment, and `spec`, as
#'   [policy_bind()] takes them.
#' @noRd
known_spaces <- function(env, client, call = rlang::caller_env()) {
  check_environment(env, call = call)
  if (is.character(env) || inherits(env, "gym_wrapped")) {
    env <- gym_make(env, client = client)
    on.exit(close_made(env, finished = FALSE))
  }
  list(
    observation_space = env$single_observation_space %||% env$observation_space,
    action_space = env$single_action_space %||% env$action_space,
    spec = env$spec
  )
}

# What was played is not lost because the environment could not be closed, and an
# error on the way here says more than one from closing.
close_made <- function(env, finished) {
  tryCatch(
    env$close(),
    gym_error = function(cnd) {
      if (finished) {
        rlang::warn(
          c("The environment could not be closed.", x = conditionMessage(cnd)),
          class = "gym_warning_close"
        )
      }
    }
  )
}

make_vector_env <- function(env_id, episodes, client) {
  own <- if (has_own_sub_envs(env_id, client)) {
    make_if_can(env_id, entry_point_sub_envs, "vector_entry_point", NULL, client)
  }
  own %||% make_if_can(env_id, min(episodes, sync_sub_envs), "sync", "Disabled", client) %||%
    gym_make(env_id, client = client)
}

# Does the server take the environment's own vector implementation where it may choose?
# Asked with one sub-environment, as others are dear to make.
has_own_sub_envs <- function(env_id, client) {
  sub_env <- make_if_can(env_id, 1L, NULL, NULL, client)
  if (is.null(sub_env)) {
    return(FALSE)
  }
  on.exit(close_made(sub_env, finished = FALSE))
  identical(sub_env$vectorization_mode, "vector_entry_point")
}

# By which the server says that fewer sub-environments, or none, may do.
fewer_sub_envs_codes <- c(
  "not_supported", "too_many_sub_envs", "too_much_memory", "unsupported_space"
)

# NULL where the server cannot make such sub-environments, or not that many.
make_if_can <- function(env_id, num_envs, vectorization_mode, autoreset_mode, client) {
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

#' Find out how an environment's sub-environments are played
#'
#' @param block How many episodes make a block where each sub-environment has a seed of its own;
#'   `NULL` for as many as there are sub-environments.
#' @return A list: the spaces of a sub-environment, `spec` and `client`, as an environment has them,
#'   for [policy_bind()]; `call`, of which errors while they play are told; `block`, how
#'   many episodes are played at once; `draw_seeds()`, which draws the seeds of a block,
#'   one for each episode; `reset(seeds)`, which gives the observations of all sub-environments;
#'   `step(action, playing)`, which takes and gives one row for each of the sub-environments
#'   `playing`; `num_envs`, with how many sub-environments an episode has to be begun again, `NULL`
#'   where its seed is enough; `frame()`, which gives the current frame as the bytes of a
#'   PNG file, `NULL` where none are wanted.
#' @noRd
vector_env_of <- function(env, block = NULL, call = rlang::caller_env(), frames = FALSE) {
  if (is.null(env$num_envs)) {
    vector_env <- single_sub_env(env, call)
  } else if (identical(env$vectorization_mode, "sync")) {
    vector_env <- sub_envs_apart(env, block %||% env$num_envs, call)
  } else {
    check_ended_sub_envs_step(env, call)
    vector_env <- sub_envs_together(env, call)
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

# Without sub-environments: one episode after the other.
single_sub_env <- function(env, call) {
  observed <- env$observation_space
  actions <- env$action_space
  list(
    observation_space = observed, action_space = actions, block = 1L,
    draw_seeds = function() draw_environment_seeds(1L),
    reset = function(seeds) sub_envs_from(observed, list(env$reset(seed = seeds))),
    step = function(action, playing) {
      out <- take_step(env, 1L, call, sub_env_value(actions, action, 1L))
      out$observation <- sub_envs_from(observed, list(out$observation))
      out
    }
  )
}

# Each sub-environment is an environment of its own, with a seed of its own, and only those that
# play are stepped.
sub_envs_apart <- function(env, block, call) {
  n <- env$num_envs
  list(
    observation_space = env$single_observation_space,
    action_space = env$single_action_space, block = block,
    draw_seeds = function() draw_environment_seeds(block),
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

# All sub-environments are always stepped, those whose episode has ended too: what they do then is
# of no interest. Where one generator serves them all, there is one seed.
sub_envs_together <- function(env, call) {
  n <- env$num_envs
  observed <- env$single_observation_space
  actions <- env$single_action_space
  one_seed <- !identical(env$vectorization_mode, "async")
  list(
    observation_space = observed, action_space = actions, block = n,
    num_envs = if (one_seed) n,
    draw_seeds = function() rep_len(draw_environment_seeds(if (one_seed) 1L else n), n),
    reset = function(seeds) env$reset(seed = if (one_seed) seeds[[1L]] else seeds),
    step = function(action, playing) {
      if (length(playing) == n) {
        return(take_step(env, n, call, action))
      }
      row <- rep(1L, n)
      row[playing] <- seq_along(playing)
      out <- take_step(env, n, call, sub_env_rows(actions, action, row))
      list(
        observation = sub_env_rows(observed, out$observation, playing),
        reward = out$reward[playing],
        terminated = out$terminated[playing],
        truncated = out$truncated[playing]
      )
    }
  )
}

# A limit of the environment's own holds whatever is asked for here.
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

check_ended_sub_envs_step <- function(env, call) {
  if (identical(env$autoreset_mode, "Disabled")) {
    gym_abort(
      c(
        paste0("Episodes of different length cannot be played in ", environment_label(env),
               " made with vectorization_mode \"", env$vectorization_mode,
               "\" and autoreset_mode \"Disabled\": all of its sub-environments are stepped ",
               "together, ",
               "and one that has ended takes no step."),
        i = "Make it with autoreset_mode \"NextStep\", or with vectorization_mode \"sync\"."
      ),
      class = "gym_error_argument", argument = "env", value = env, call = call
    )
  }
}
