#' See an environment as a vector environment to play in
#'
#' Whatever is played is played through this: [rollout()] and every search call it, and ask nothing
#' else of an environment. A method for a class of your own makes environments of another kind
#' that all of them can play.
#'
#' An environment that is named by its id is made, and closed by `$close()`. It gets 256
#' sub-environments where Gymnasium has a vector implementation of it that plays the same game,
#' otherwise 16; none where the server cannot make them or where a wrapper remembers something over
#' episodes (`NormalizeObservation`, `NormalizeReward`). One that was made before is played as it
#' is, and left open.
#'
#' @param x The environment: an id such as `"CartPole-v1"`, perhaps with wrappers (see
#'   [gym_wrap()]), an environment made by [gym_make()] or [gym_env()], or any list or environment
#'   with functions `reset(seed)` and `step(action)` and the elements `observation_space`,
#'   `action_space` and `spec`.
#' @param num_envs How many sub-environments to make, a whole number of at least 1. `NULL`, the
#'   default, chooses; an environment that was made before has the number that it has.
#' @param ... The environment's own arguments, by name, where it is named by its id.
#' @param max_envs No more sub-environments than this are made where `num_envs` is `NULL` and each
#'   has a seed of its own, a number; by default there is no limit.
#' @param frames Are frames wanted? `FALSE`, the default, or `TRUE`: then there is one
#'   sub-environment.
#' @param client The client of the server where an environment named by its id is made; the default
#'   is the session's own, [gym_client()].
#' @return An object of class `gym_vector_env`, a list with the elements
#'   \describe{
#'     \item{observation_space, action_space}{Those of one sub-environment.}
#'     \item{spec}{A list of `id` (a string), `reward_threshold`, `max_episode_steps` and
#'       `render_fps` (numbers or `NULL`).}
#'     \item{num_envs}{How many sub-environments there are, an integer.}
#'     \item{batch_size}{How many episodes make a batch, an integer.}
#'     \item{one_seed}{`TRUE` where one random generator serves all sub-environments, which are
#'       then reset together; `FALSE` where each has a seed of its own.}
#'     \item{reset(seeds, which)}{A function that starts episodes and returns the first
#'       observations, a row for each: with `one_seed` in all sub-environments, `seeds` being one
#'       whole number; otherwise in the sub-environments with the numbers `which`, in increasing
#'       order, with a seed for each.}
#'     \item{step(action, which)}{A function that steps the sub-environments with the numbers
#'       `which`; `action` has a row for each of these, and so has what it returns, a list of
#'       `observation`, `reward`, `terminated`, `truncated` and `next_observation`.}
#'     \item{frame()}{A function that returns the current frame as the bytes of a PNG file; `NULL`
#'       where no frames are wanted.}
#'     \item{remembers}{The names of wrappers that remember something over episodes, strings; then
#'       the episodes are never split over batches.}
#'     \item{client}{The client of the server, `NULL` where there is none.}
#'     \item{close(wait)}{A function that closes what was made here, and nothing else; with
#'       `wait = FALSE` without waiting for the server.}
#'   }
#' @section Errors: `gym_error_argument` for something that is no environment; those of
#'   [gym_make()] where one is made.
#' @seealso [rollout()]
#' @export
#' @examplesIf gym:::can_start_server()
#' lakes <- as_vector_env("FrozenLake-v1", num_envs = 3, is_slippery = FALSE)
#' lakes$reset(seeds = 1:3, which = 1:3)
#' str(lakes$step(c(2L, 1L), which = c(1L, 3L)))
#' lakes$close()
as_vector_env <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                          client = gym_client()) {
  UseMethod("as_vector_env")
}

#' @export
as_vector_env.character <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                    client = gym_client()) {
  check_environment(x)
  if (is_registered(x)) {
    return(registered_vector_env(x, num_envs, list(...), max_envs, frames))
  }
  call <- rlang::caller_env()
  env <- make_vector_env(x, num_envs, list(...), max_envs, frames, client, call)
  vector_env <- vector_env_of(env, frames, batch_size = num_envs %||% sync_sub_envs)
  vector_env$close <- function(wait = TRUE) {
    # A server that hangs must not be waited for again.
    if (wait) close_or_warn(env) else close_unused(env$client, env$instance_id)
  }
  vector_env
}

#' @export
as_vector_env.gym_wrapped <- as_vector_env.character

#' @export
as_vector_env.default <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                  client = gym_client()) {
  check_environment(x)
  check_made_before(num_envs, list(...), x)
  vector_env_of(x, frames)
}

check_made_before <- function(num_envs, arguments, env, call = rlang::caller_env()) {
  given <- c(if (!is.null(num_envs)) "num_envs", names(arguments), if (length(arguments)) "...")
  if (length(given)) {
    gym_abort(
      c(paste0("`", given[[1L]], "` is for an environment that is made here, and this ",
               environment_label(env), " was made before."),
        i = "Name it by its id, or give the argument to `gym_make()`."),
      class = "gym_error_argument", argument = given[[1L]], call = call
    )
  }
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

# Making one from its id -------------------------------------------------------------

# How many sub-environments an environment gets that is made from its id, and so how many episodes
# make a batch. These numbers must not depend on how many episodes are asked for: then the first
# episodes are the same however many follow.
entry_point_sub_envs <- 256L
sync_sub_envs <- 16L

make_vector_env <- function(env_id, num_envs, arguments, max_envs, frames, client, call) {
  make <- function(num_envs, vectorization_mode = NULL, autoreset_mode = NULL) {
    rlang::exec(
      make_unseeded, env_id, !!!arguments, num_envs = num_envs,
      vectorization_mode = vectorization_mode, autoreset_mode = autoreset_mode, client = client,
      call = call
    )
  }
  if (frames || length(remembering(wrapper_names(noted_wrappers(env_id))))) {
    return(make(NULL))
  }
  own <- if (has_vector_implementation(make)) {
    if_supported(make(num_envs %||% entry_point_sub_envs, "vector_entry_point"))
  }
  if (!is.null(num_envs)) {
    return(own %||% make(num_envs, "sync", "Disabled"))
  }
  own %||% if_supported(make(min(max_envs, sync_sub_envs), "sync", "Disabled")) %||% make(NULL)
}

# Does the server choose the environment's own vector implementation where it may choose? The
# question is asked with one sub-environment, because making many takes long.
has_vector_implementation <- function(make) {
  sub_env <- if_supported(make(1L))
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

# Evaluates code that makes an environment. NULL where the server cannot make such sub-environments,
# or not that many.
if_supported <- function(code) {
  tryCatch(
    code,
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% fewer_sub_envs_codes)) {
        rlang::cnd_signal(cnd)
      }
    }
  )
}

# Seeing one as a vector environment ---------------------------------------------------

#' Describe an environment that was made as a vector environment
#'
#' @param batch_size How many episodes make a batch where each sub-environment has a seed of its
#'   own; `NULL` for as many as there are sub-environments.
#' @return As [as_vector_env()].
#' @noRd
vector_env_of <- function(env, frames = FALSE, batch_size = NULL, call = rlang::caller_env()) {
  vector_env <- if (is.null(env$num_envs)) {
    single_env(env)
  } else if (identical(env$vectorization_mode, "sync")) {
    independent_sub_envs(env)
  } else {
    check_ended_can_step(env, call)
    joint_sub_envs(env)
  }
  vector_env$spec <- env$spec
  vector_env$client <- env$client
  vector_env$batch_size <- as.integer(
    if (vector_env$one_seed || is.null(env$num_envs)) vector_env$num_envs
    else batch_size %||% vector_env$num_envs
  )
  vector_env$remembers <- remembering(env$spec$wrappers)
  vector_env$close <- function(wait = TRUE) NULL
  if (frames) {
    check_draws(env, call)
    vector_env$frame <- function() png_frame(env$client, env$instance_id, call)
  }
  structure(vector_env, class = "gym_vector_env")
}

# An environment without sub-environments plays one episode after the other.
single_env <- function(env) {
  observed <- env$observation_space
  actions <- env$action_space
  list(
    observation_space = observed, action_space = actions, num_envs = 1L, one_seed = FALSE,
    reset = function(seeds, which = 1L) batch_of(observed, list(env$reset(seed = seeds))),
    step = function(action, which = 1L) {
      out <- take_step(env, 1L, batch_value(actions, action, 1L))
      out$observation <- batch_of(observed, list(out$observation))
      out$next_observation <- out$observation
      out
    }
  )
}

# With "sync", each sub-environment is an environment of its own: it has a seed of its own, and only
# those that are playing are stepped.
independent_sub_envs <- function(env) {
  n <- env$num_envs
  space <- env$single_observation_space
  was_reset <- FALSE
  # The first time all are reset, because the others have no episode yet; and so it is always with
  # an environment of the user's, which need not know masks.
  reset <- function(seeds, which) {
    some <- was_reset && length(which) < n && inherits(env, "gym_server_env")
    seed <- rep(if (some) NA_real_ else seeds, length.out = n)
    seed[which] <- seeds
    observation <- if (some) {
      env$reset(seed = seed, mask = seq_len(n) %in% which)
    } else {
      env$reset(seed = seed)
    }
    was_reset <<- TRUE
    batch_rows(space, observation, which)
  }
  list(
    observation_space = space, action_space = env$single_action_space, num_envs = n,
    one_seed = FALSE, reset = reset,
    step = function(action, which) {
      out <- if (length(which) == n) {
        take_step(env, n, action)
      } else {
        take_step(env, length(which), action, which = which)
      }
      out$next_observation <- out$next_observation %||% out$observation
      out
    }
  )
}

# With "vector_entry_point" and "async", all sub-environments are always stepped, also those whose
# episode has ended; what these return is left out. With "vector_entry_point" one generator serves
# all sub-environments, so there is one seed for all.
joint_sub_envs <- function(env) {
  n <- env$num_envs
  observed <- env$single_observation_space
  actions <- env$single_action_space
  one_seed <- !identical(env$vectorization_mode, "async")
  rows <- function(out, which) {
    out <- out[c("observation", "reward", "terminated", "truncated", "next_observation")]
    if (length(which) == n) {
      return(out)
    }
    # The two are nearly always the same, which identical() sees at once.
    same <- identical(out$observation, out$next_observation)
    observation <- batch_rows(observed, out$observation, which)
    after <- if (same) observation else batch_rows(observed, out$next_observation, which)
    list(
      observation = observation, reward = out$reward[which],
      terminated = out$terminated[which], truncated = out$truncated[which],
      next_observation = after
    )
  }
  reset <- if (one_seed) {
    function(seeds, which = NULL) env$reset(seed = seeds)
  } else {
    independent_sub_envs(env)$reset
  }
  list(
    observation_space = observed, action_space = actions, num_envs = n, one_seed = one_seed,
    reset = reset,
    step = function(action, which) {
      out <- take_step(env, n, actions_of_all(actions, action, which, n))
      out$next_observation <- out$next_observation %||% out$observation
      rows(out, which)
    }
  )
}

# The actions of all sub-environments: those that have ended repeat that of the first that plays.
actions_of_all <- function(space, action, which, n) {
  if (length(which) == n) {
    return(action)
  }
  row <- rep(1L, n)
  row[which] <- seq_along(which)
  batch_rows(space, action, row)
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
