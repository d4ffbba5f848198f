#' See an environment as a vector environment to play in
#'
#' Whatever is played is played through this: [rollout()] and every search call it, and ask nothing
#' else of an environment. A method for a class of your own makes environments of another kind
#' that all of them can play.
#'
#' An environment that is named by its id is made, and closed by `$close()`. It gets 256
#' sub-environments; where an observation is large fewer, so that those of all together take no
#' more than a mebibyte, but at least 16; and none where a wrapper remembers something over episodes
#' (`NormalizeObservation`, `NormalizeReward`). A server that cannot make so many makes a quarter of
#' them, 16, or a single environment. Where Gymnasium has a vector implementation that plays the
#' same game it is taken; elsewhere each sub-environment has a seed of its own, and the server
#' divides them among processes where that pays. One that was made before is played as it is, and
#' left open.
#'
#' @param x The environment: an id such as `"CartPole-v1"`, perhaps with wrappers (see
#'   [gym_wrap()]), an environment made by [gym_make()] or [gym_env()], or any list or environment
#'   with functions `reset(seed)` and `step(action)` and the elements `observation_space`,
#'   `action_space` and `spec`.
#' @param num_envs How many sub-environments to make, a whole number of at least 1. `NULL`, the
#'   default, chooses; an environment that was made before has the number that it has.
#' @param num_workers How many processes run the sub-environments, a whole number: 0 for none but
#'   the server itself. `NULL`, the default, lets the server choose, and takes none for fewer than
#'   32 episodes (`max_envs`). What is played does not depend on it. Only where the environment is
#'   named by its id and has no vector implementation of its own.
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
#'     \item{begins_next}{`TRUE` where a sub-environment that has ended begins its next episode by
#'       itself, in the same step, as long as it has seeds. `FALSE` or `NULL` where it must be
#'       reset.}
#'     \item{endless}{`TRUE` where it is known that no episode ever ends, so that it is played with
#'       `max_steps` only. `FALSE` or `NULL` elsewhere.}
#'     \item{possible}{Where a model is played, a logical matrix of the actions that can be taken,
#'       with a row for each state and a column for each action; else `NULL`.}
#'     \item{reset(seeds, which)}{A function that starts episodes and returns the first
#'       observations, a row for each: with `one_seed` in all sub-environments, `seeds` being one
#'       whole number; otherwise in the sub-environments with the numbers `which`, in increasing
#'       order, with a seed for each. With `begins_next` `seeds` may also be a list with a vector of
#'       seeds for each: the first for now, the others for the episodes that it begins by itself.}
#'     \item{step(action, which)}{A function that steps the sub-environments with the numbers
#'       `which`; `action` has a row for each of these, and so has what it returns, a list of
#'       `observation`, `reward`, `terminated`, `truncated` and `next_observation`, which is what
#'       the step led to. `observation` is the same, but where another episode began in this step:
#'       there it is the first one of that episode.}
#'     \item{step_bare(action, which)}{As `step()`, without `next_observation`, where that is
#'       quicker; otherwise `NULL`.}
#'     \item{frame()}{A function that returns the current frame as the bytes of a PNG file; `NULL`
#'       where no frames are wanted.}
#'     \item{remembers}{The names of wrappers that remember something over episodes, strings; then
#'       the episodes are never split over batches.}
#'     \item{env}{The environment that it plays, with the functions `reset()` and `step()` of
#'       [gym_make()], which return infos; `NULL` where there is no such one, as with several
#'       sub-environments in R.}
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
                          client = gym_client(), num_workers = NULL) {
  UseMethod("as_vector_env")
}

#' @export
as_vector_env.character <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                    client = gym_client(), num_workers = NULL) {
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
      make_unseeded, x, !!!arguments, num_envs = num_envs, ..., client = client, call = call
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
    # A server that hangs must not be waited for again.
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

# Frames are kept of one sub-environment, which plays one episode after the other.
check_one_framed <- function(num_envs, frames, call = rlang::caller_env()) {
  if (frames && isTRUE(num_envs > 1)) {
    gym_abort(
      c(paste0("`num_envs` must be 1 where frames are kept, not ", num_envs, "."),
        i = "Leave it out, or leave out `frames = TRUE`."),
      class = "gym_error_argument", argument = "num_envs", value = num_envs, call = call
    )
  }
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

# Seeing one as a vector environment ---------------------------------------------------

#' Describe an environment that was made as a vector environment
#'
#' @param batch_size How many episodes make a batch where each sub-environment has a seed of its
#'   own; `NULL` for what follows from how many sub-environments there are.
#' @return As [as_vector_env()].
#' @noRd
vector_env_of <- function(env, frames = FALSE, batch_size = NULL, call = rlang::caller_env()) {
  vector_env <- if (is.null(env$num_envs)) {
    single_env(env)
  } else if (identical(env$vectorization_mode, "vector_entry_point")) {
    check_ended_can_step(env, call)
    joint_sub_envs(env)
  } else {
    independent_sub_envs(env)
  }
  vector_env$spec <- env$spec
  vector_env$client <- env$client
  vector_env$env <- env
  vector_env$batch_size <- if (vector_env$one_seed || is.null(env$num_envs)) {
    vector_env$num_envs
  } else {
    batch_size %||% episodes_of_batch(vector_env$num_envs)
  }
  vector_env$remembers <- remembering(env$spec$wrappers)
  vector_env$close <- function(wait = TRUE) NULL
  if (frames) {
    check_draws(env, call)
    vector_env$frame <- function() png_frame(env$client, env$instance_id, call)
    # The last frame of an episode is drawn before the next one begins.
    vector_env$begins_next <- FALSE
  }
  structure(vector_env, class = "gym_vector_env")
}

# How many episodes make a batch in sub-environments with seeds of their own: with four of them
# each, few sub-environments have nothing to play while the last episodes end. Where there is only
# one, what is interrupted loses no episode that has ended.
episodes_of_batch <- function(num_envs) {
  as.integer(if (num_envs == 1L) 1L else 4L * num_envs)
}

# An environment without sub-environments plays one episode after the other.
single_env <- function(env) {
  observed <- env$observation_space
  actions <- env$action_space
  list(
    observation_space = observed, action_space = actions, num_envs = 1L, one_seed = FALSE,
    reset = function(seeds, which = 1L) batch_of(observed, list(first_observation(env, seeds))),
    step = function(action, which = 1L) {
      out <- take_step(env, 1L, batch_value(actions, action, 1L))
      out$observation <- batch_of(observed, list(out$observation))
      out$next_observation <- out$observation
      out
    }
  )
}

# With "sync" and "async" each sub-environment is an environment of its own: it has a seed of its
# own, and only those that are playing are stepped. Only a server's environments have `num_workers`;
# what else has sub-environments need not know how to begin an episode by itself.
independent_sub_envs <- function(env) {
  n <- env$num_envs
  space <- env$single_observation_space
  # The first time all are reset, because the others have no episode yet.
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

# Makes the function `step_bare()` of sub-environments that rest after their last episode.
bare_stepper <- function(env) {
  choose <- step_chooser(env)
  function(action, which) {
    step <- choose(action, which)
    out <- take_step(env, step$n, step$action, step$which, finals = FALSE)
    if (is.null(step$row)) out else rows_of_step(env$single_observation_space, out, step$row)
  }
}

# Makes a function that decides which sub-environments are stepped for those that play. Others that
# were stepped before are stepped along, whose results nobody uses: a request for other
# sub-environments is another request, which has to be prepared. When fewer than half of them still
# play, the others are left out.
step_chooser <- function(env) {
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
    list(
      action = if (along) actions_of_all(actions, action, row, count) else action,
      which = if (count < n) stepped, n = count, row = if (along) row
    )
  }
}

# Some rows of what a step returned.
rows_of_step <- function(space, out, row) {
  # The two are nearly always the same, which identical() sees at once.
  same <- identical(out$observation, out$next_observation)
  observation <- batch_rows(space, out$observation, row)
  list(
    observation = observation, reward = out$reward[row], terminated = out$terminated[row],
    truncated = out$truncated[row],
    next_observation = if (same) observation else batch_rows(space, out$next_observation, row)
  )
}

# With "vector_entry_point" one generator serves all sub-environments, so there is one seed for all.
# All are always stepped, also those whose episode has ended; what these return is left out.
joint_sub_envs <- function(env) {
  n <- env$num_envs
  observed <- env$single_observation_space
  actions <- env$single_action_space
  rows <- function(out, which) {
    out <- out[c("observation", "reward", "terminated", "truncated", "next_observation")]
    if (length(which) == n) {
      return(out)
    }
    rows_of_step(observed, out, which)
  }
  list(
    observation_space = observed, action_space = actions, num_envs = n, one_seed = TRUE,
    reset = function(seeds, which = NULL) first_observation(env, seeds),
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
