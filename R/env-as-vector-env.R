#' Convert an environment to a vector environment to play in
#'
#' All functions that play use this interface: [rollout()] and every search call it, and use nothing
#' else of an environment. Write a method for your own class to let all of them play another kind of
#' environment.
#'
#' An environment given by its id is made, and closed by `$close()`. It gets 256 sub-environments.
#' It gets fewer if observations are large, so that all together take at most a mebibyte, but at
#' least 16. It gets none if a wrapper remembers something over episodes (`NormalizeObservation`,
#' `NormalizeReward`). If the server cannot make that many, it makes a quarter of them, 16, or a
#' single environment. Gymnasium's vector implementation is used if it plays the same game.
#' Otherwise each sub-environment has its own seed, and the server divides them among processes if
#' that is faster. An environment that was made before is used as it is, and stays open.
#'
#' @param x The environment: an id such as `"CartPole-v1"` (with wrappers, see [gym_wrap()]), an
#'   environment made by [gym_make()] or [gym_env()], or any list or environment with functions
#'   `reset(seed)` and `step(action)` and the elements `observation_space`, `action_space` and
#'   `spec`.
#' @param num_envs The number of sub-environments to make, a whole number of at least 1. `NULL`, the
#'   default, chooses. An environment that was made before keeps its number.
#' @param num_workers The number of processes that run the sub-environments, a whole number: 0 for
#'   the server's own process. `NULL`, the default, lets the server choose, and uses none for
#'   fewer than 32 episodes (`max_envs`). The result does not depend on it. Only if the environment
#'   is given by its id and has no vector implementation of its own.
#' @param ... Arguments of the environment, by name, if it is given by its id.
#' @param max_envs The largest number of sub-environments if `num_envs` is `NULL` and each has its
#'   own seed, a number. By default there is no limit.
#' @param frames Keep frames? `FALSE`, the default, or `TRUE`, which uses one sub-environment.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the session's client, [gym_client()].
#' @return An object of class `gym_vector_env`, a list with the elements
#'   \describe{
#'     \item{observation_space, action_space}{Those of one sub-environment.}
#'     \item{spec}{A list of `id` (a string), `reward_threshold`, `max_episode_steps` and
#'       `render_fps` (numbers or `NULL`).}
#'     \item{num_envs}{The number of sub-environments, an integer.}
#'     \item{batch_size}{The number of episodes in a batch, an integer.}
#'     \item{one_seed}{`TRUE` if all sub-environments share one random generator; they are then
#'       reset together. `FALSE` if each has its own seed.}
#'     \item{begins_next}{`TRUE` if a sub-environment starts its next episode itself in the step
#'       that ends an episode, as long as it has seeds. `FALSE` or `NULL` if it must be reset.}
#'     \item{endless}{`TRUE` if it is known that no episode ever ends; it can then be played with
#'       `max_steps` only. Otherwise `FALSE` or `NULL`.}
#'     \item{possible}{For a model, a logical matrix of the valid actions, with a row for each state
#'       and a column for each action; otherwise `NULL`.}
#'     \item{reset(seeds, which)}{A function that starts episodes and returns the first
#'       observations, a row for each. With `one_seed`, it resets all sub-environments and `seeds`
#'       is one whole number. Otherwise it resets the sub-environments with the numbers `which`, in
#'       increasing order, with a seed for each. With `begins_next`, `seeds` may also be a list with
#'       a vector of seeds for each: the first for now, the others for the episodes that it starts
#'       itself.}
#'     \item{step(action, which)}{A function that steps the sub-environments with the numbers
#'       `which`. `action` has a row for each of these, and so has the result, a list of
#'       `observation`, `reward`, `terminated`, `truncated` and `next_observation`, the observation
#'       after the step. `observation` is the same, unless the step also started another episode: it
#'       is then the first observation of that episode.}
#'     \item{step_bare(action, which)}{As `step()`, without `next_observation`, if that is faster;
#'       otherwise `NULL`.}
#'     \item{frame()}{A function that returns the current frame as the bytes of a PNG file; `NULL`
#'       without `frames`.}
#'     \item{remembers}{The names of wrappers that remember something over episodes, strings. All
#'       episodes are then in one batch.}
#'     \item{env}{The environment that it plays, with the functions `reset()` and `step()` of
#'       [gym_make()], which return infos; `NULL` if there is none, as for several sub-environments
#'       in R.}
#'     \item{client}{The client of the server, or `NULL`.}
#'     \item{close(wait)}{A function that closes what was made here, and nothing else; with
#'       `wait = FALSE` without waiting for the server.}
#'   }
#' @section Errors: `gym_error_argument` for an object that is not an environment. As for
#'   [gym_make()] if an environment is made.
#' @seealso [rollout()]
#' @export
#' @examplesIf gym:::can_start_server()
#' lakes <- as_vector_env("FrozenLake-v1", num_envs = 3, is_slippery = FALSE)
#' lakes$reset(seeds = 1:3, which = 1:3)
#' str(lakes$step(c(2L, 1L), which = c(1L, 3L)))
#' lakes$close()
as_vector_env <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                          client = gym_client(), num_workers = NULL) {
  UseMethod("as_vector_env")
}

#' @export
as_vector_env.character <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                    client = gym_client(), num_workers = NULL) {
  match_whole_names()
  check_environment(x)
  check_one_framed(num_envs, frames)
  check_count(num_workers, min = 0, allow_null = TRUE)
  if (is_registered(x)) {
    check_for_r(x, list(num_workers = num_workers))
    return(registered_vector_env(x, num_envs, list(...), max_envs, frames))
  }
  call <- rlang::caller_env()
  arguments <- list(...)
  check_dots_named(arguments, "seed = 1", call)
  check_client(client, call = call)
  make <- function(num_envs, ...) {
    rlang::exec(
      make_unseeded, env_id = x, !!!arguments, num_envs = num_envs, ..., client = client,
      call = call
    )
  }
  single <- frames || length(remembering(wrapper_names(noted_wrappers(x))))
  made <- if (single) {
    list(env = make(NULL))
  } else {
    own <- arguments[!rlang::names2(arguments) %in% how_made()]
    described <- known_description(client, without_transforms(x), own, call)
    make_sub_envs(make, described, num_envs, num_workers, max_envs, call)
  }
  env <- made$env
  vector_env <- vector_env_of(env, frames, made$batch_size)
  vector_env$close <- function(wait = TRUE) {
    # Do not wait again for a server that hangs.
    if (wait) close_or_warn(env) else close_unused(env$client, env$instance_id)
  }
  vector_env
}

#' @export
as_vector_env.gym_wrapped <- as_vector_env.character

#' @export
as_vector_env.default <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                  client = gym_client(), num_workers = NULL) {
  check_environment(x)
  check_made_before(num_envs, c(list(...), num_workers = num_workers), x)
  vector_env_of(x, frames)
}

# Frames are kept with one sub-environment, which plays one episode after the other.
check_one_framed <- function(num_envs, frames, call = rlang::caller_env()) {
  if (frames && isTRUE(num_envs > 1)) {
    gym_abort(
      c(paste0("`num_envs` must be 1 to keep frames, not ", num_envs, "."),
        i = "Leave it out, or leave out `frames = TRUE`."),
      class = "gym_error_argument", argument = "num_envs", value = num_envs, call = call
    )
  }
}

check_made_before <- function(num_envs, arguments, env, call = rlang::caller_env()) {
  given <- c(if (!is.null(num_envs)) "num_envs", names(arguments), if (length(arguments)) "...")
  if (length(given)) {
    gym_abort(
      c(paste0("`", given[[1L]], "` is for an environment given by its id, but this ",
               environment_label(env), " was made before."),
        i = did_you_mean(given[[1L]], arguments_of(passed_on_by(given[[1L]]))) %||%
          "Give its id instead, or pass the argument to `gym_make()`."),
      class = "gym_error_argument", argument = given[[1L]], call = call
    )
  }
}

# A failure to close must not lose the results.
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

#' Construct a vector environment, the one thing that everything plays
#'
#' The arguments are its elements. [as_vector_env()] says what the first ones promise; those without
#' a default are always there. Play adds `call`, the user's call, which errors name, and `recipe`,
#' see [environment_recipe()]. Models add `model`, `possible` and `endless`.
#' @param reset,step `NULL` only with `description`.
#' @param step_one If there is one sub-environment: a function of one action that returns a step.
#' @param guard If that is in R: a function that evaluates many such steps and adds the place to
#'   their errors.
#' @param description What a server needs to play whole episodes itself, see [describe_env()]; it
#'   then also has `known`, what is known about the environment, and `make_stepped()`, which makes
#'   the environment that R steps.
#' @noRd
new_vector_env <- function(observation_space, action_space, spec, num_envs, batch_size, one_seed,
                           reset = NULL, step = NULL, step_bare = NULL, begins_next = FALSE,
                           frame = NULL, remembers = character(), env = NULL, client = NULL,
                           close = function(wait = TRUE) invisible(), step_one = NULL,
                           guard = NULL, description = NULL) {
  structure(mget(names(formals())), class = "gym_vector_env")
}

# Seeing one as a vector environment ---------------------------------------------------

#' Convert an environment that was made before to a vector environment
#'
#' @param batch_size The number of episodes in a batch if each sub-environment has its own seed;
#'   `NULL` to derive it from the number of sub-environments.
#' @return As [as_vector_env()].
#' @noRd
vector_env_of <- function(env, frames = FALSE, batch_size = NULL, call = rlang::caller_env()) {
  parts <- if (is.null(env$num_envs)) {
    single_env(env)
  } else if (identical(env$vectorization_mode, "vector_entry_point")) {
    check_ended_can_step(env, call)
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
    # The last frame of an episode is drawn before the next one begins.
    parts$begins_next <- FALSE
  }
  rlang::exec(
    new_vector_env, !!!parts, spec = env$spec, remembers = remembering(env$spec$wrappers),
    env = env, client = env$client
  )
}

# The number of episodes in a batch for sub-environments with their own seeds. With four episodes
# each, few sub-environments are idle while the last episodes end. With a single one, an interrupt
# loses no finished episode.
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

# With "sync" and "async" each sub-environment is an environment with its own seed, and only those
# that play are stepped. Only a server's environments have `num_workers`; others need not be able to
# start an episode themselves.
independent_sub_envs <- function(env) {
  n <- env$num_envs
  space <- env$single_observation_space
  # The first reset is for all, because none has an episode yet.
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

# Makes the function `step_bare()` of sub-environments that rest after their last episode. Those
# that were stepped before are stepped along, and their results ignored: another set needs a new
# request, which takes time to prepare. When fewer than half of them still play, the others are left
# out.
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
  # The two are nearly always the same object, which identical() detects at once.
  same <- identical(out$observation, out$next_observation)
  observation <- batch_rows(space, out$observation, row)
  list(
    observation = observation, reward = out$reward[row], terminated = out$terminated[row],
    truncated = out$truncated[row],
    next_observation = if (same) observation else batch_rows(space, out$next_observation, row)
  )
}

# With "vector_entry_point" all sub-environments share one generator and one seed. All are always
# stepped, including those whose episode has ended; their results are ignored.
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

# The actions of all sub-environments: those that have ended repeat the action of the first that
# plays.
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
