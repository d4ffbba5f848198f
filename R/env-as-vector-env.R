#' Convert an environment to a vector environment to play in
#'
#' Functions that play step by step, such as [rollout()] and every search, use an environment only
#' through this interface. Write a method for your own class, and all of them can play it.
#'
#' If you give an id, the function makes the environment, and `$close()` closes it. The environment
#' has 256 sub-environments. It has fewer if observations are large: all observations together take
#' at most a mebibyte, but there are at least 16 sub-environments. It is a single environment if a
#' wrapper remembers earlier episodes (`NormalizeObservation`, `NormalizeReward`). If the server
#' cannot make that many sub-environments, the function tries a quarter of the number, then 16, then
#' a single environment. It uses Gymnasium's vector implementation if that plays the same game.
#' Otherwise each sub-environment has its own seed, and the server divides the sub-environments
#' among processes if that is faster. An environment that you made before is used as it is, and
#' stays open.
#'
#' @param x The environment: an id such as `"CartPole-v1"` (with wrappers, see [gym_wrap()]), an
#'   environment made by [gym_make()] or [gym_env()], or any list or environment with functions
#'   `reset(seed)` and `step(action)` and the elements `observation_space`, `action_space` and
#'   `spec`.
#' @param num_envs The number of sub-environments to make, a whole number of at least 1. `NULL`, the
#'   default, chooses. An environment that was made before keeps its number.
#' @param num_workers The number of processes that run the sub-environments, a whole number: 0 for
#'   the server's own process. `NULL`, the default, lets the server choose, and uses none for fewer
#'   than 32 episodes (`max_envs`). The results do not depend on it. Use it only for an environment
#'   given by its id that has no vector implementation of its own.
#' @param ... Arguments of the environment, by name, if it is given by its id.
#' @param max_envs The largest number of sub-environments to choose, a number, if `num_envs` is
#'   `NULL` and each sub-environment has its own seed. By default there is no limit.
#' @param frames Keep frames? `FALSE`, the default, or `TRUE`, which uses one sub-environment.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the session's client, [gym_client()].
#' @return An object of class `gym_vector_env`, a list with the elements
#'   \describe{
#'     \item{observation_space, action_space}{The spaces of one sub-environment.}
#'     \item{spec}{A list of `id` (a string), `reward_threshold`, `max_episode_steps` and
#'       `render_fps` (numbers or `NULL`).}
#'     \item{num_envs}{The number of sub-environments, an integer.}
#'     \item{batch_size}{The number of episodes in a batch, an integer.}
#'     \item{one_seed}{`TRUE` if all sub-environments share one random generator; they are then
#'       reset together. `FALSE` if each has its own seed.}
#'     \item{begins_next}{`TRUE` if a sub-environment starts its next episode itself in the step
#'       that ends an episode, as long as it has seeds. `FALSE` or `NULL` if it must be reset.}
#'     \item{endless}{`TRUE` if it is known that no episode ever ends; playing it then requires
#'       `max_steps`. Otherwise `FALSE` or `NULL`.}
#'     \item{possible}{For a model, a logical matrix of the valid actions, with a row for each state
#'       and a column for each action; otherwise `NULL`.}
#'     \item{reset(seeds, which)}{A function that starts episodes and returns the first
#'       observations, a row for each. With `one_seed`, it resets all sub-environments and `seeds`
#'       is one whole number. Otherwise it resets the sub-environments with the numbers `which`, in
#'       increasing order, with a seed for each. With `begins_next`, `seeds` may also be a list with
#'       a vector of seeds for each sub-environment. The first seed is for this episode, the others
#'       are for the episodes that the sub-environment starts itself.}
#'     \item{step(action, which)}{A function that steps the sub-environments with the numbers
#'       `which`. `action` has a row for each of these, and so has the result, a list of
#'       `observation`, `reward`, `terminated`, `truncated` and `next_observation`, the observation
#'       after the step. `observation` equals `next_observation`, unless the step also started
#'       another episode. Then it is the first observation of that episode.}
#'     \item{step_bare(action, which)}{As `step()`, without `next_observation`, if that is faster;
#'       otherwise `NULL`.}
#'     \item{frame()}{A function that returns the current frame as the bytes of a PNG file; `NULL`
#'       without `frames`.}
#'     \item{remembers}{The names of the wrappers that remember earlier episodes, strings. If there
#'       are any, all episodes are in one batch.}
#'     \item{env}{The environment itself, whose `reset()` and `step()` also return infos, as those
#'       of [gym_make()]. `NULL` if there is no such object, as for several sub-environments in R.}
#'     \item{client}{The client of the server, or `NULL`.}
#'     \item{close(wait)}{A function that closes the environment if `as_vector_env()` made it. With
#'       `wait = FALSE`, it does not wait for the server.}
#'   }
#' @section Errors: `gym_error_argument` for an object that is not an environment. If it makes an
#'   environment, also the errors of [gym_make()].
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
  given <- given_id(x)
  if (given$registered) {
    check_for_r(x, list(num_workers = num_workers))
    env <- make_registered(x, list(...), rlang::current_env())
    return(as_vector_env(env, num_envs, max_envs = max_envs, frames = frames))
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
  single <- frames || length(given$remembers)
  made <- if (single) {
    list(env = make(NULL))
  } else {
    own <- arguments[!rlang::names2(arguments) %in% how_made]
    # The same environment without the wrappers that are applied in R.
    inside <- if (given$calls_r) {
      with_wrappers(given$id, split_wrappers(given$wrappers, NULL)$server)
    } else {
      x
    }
    described <- known_description(client, inside, own, call)
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
    abort_wrong("num_envs", num_envs, call, "`num_envs` must be 1 to keep frames, not {num_envs}.",
                i = "Leave it out, or leave out `frames = TRUE`.")
  }
}

check_made_before <- function(num_envs, arguments, env, call = rlang::caller_env()) {
  given <- c(if (!is.null(num_envs)) "num_envs", names(arguments), if (length(arguments)) "...")
  if (length(given)) {
    near <- did_you_mean(given[[1L]], arguments_of(passed_on_by(given[[1L]])))
    abort_wrong(given[[1L]], NULL, call,
                "`{given[[1L]]}` is for an environment given by its id, but this
                 {environment_label(env)} was made before.",
                i = near %||% "Give its id instead, or pass the argument to `gym_make()`.")
  }
}

# A failure to close must not lose the results.
close_or_warn <- function(env) {
  tryCatch(env$close(), gym_error = function(cnd) {
    rlang::warn(c("The environment could not be closed.", x = conditionMessage(cnd)),
                class = "gym_warning_close")
  })
}

# Making an environment from an id ---------------------------------------------------------

# The number of sub-environments of an environment made from its id.
#
# The rule depends on the environment and the number of episodes, never on cores, workers or time.
# So a seed gives the same results everywhere. Many sub-environments share the cost of a message and
# of a call of the policy. With too many, messages are large, and most sub-environments wait while
# the last episodes of a batch end.

entry_point_sub_envs <- 256L
most_sub_envs <- 256L
fewest_sub_envs <- 16L

# The most bytes that the observations of more than 16 sub-environments may take together.
most_observation_bytes <- 2^20

# Fewer episodes than this do not use worker processes.
few_episodes <- 32L

#' Choose the number of sub-environments with their own seeds
#' @return A power of two, an integer.
#' @noRd
count_sub_envs <- function(observation_bytes) {
  room <- 2^floor(log2(most_observation_bytes / max(observation_bytes, 1)))
  as.integer(min(most_sub_envs, max(fewest_sub_envs, room)))
}

# The size of an observation in a message. It counts only arrays, which may be large.
observation_bytes <- function(space) {
  if (has_parts(space)) {
    sum(vapply(space$spaces, observation_bytes, 0))
  } else if (inherits(space, "gym_space_array")) {
    bits <- suppressWarnings(as.numeric(sub("^[a-z]+", "", space$dtype)))
    prod(space$shape) * if (is.na(bits)) 1 else bits / 8
  } else {
    0
  }
}

#' Make an environment with sub-environments, or without any if the server cannot make them
#'
#' @param make A function that makes the environment. Its arguments are the number of
#'   sub-environments and how they run.
#' @param described As returned by [known_description()].
#' @return A list: `env`, the environment, and `batch_size`, the number of episodes in a batch if
#'   each sub-environment has its own seed.
#' @noRd
make_sub_envs <- function(make, described, num_envs, num_workers, max_envs, call) {
  own_implementation <- isTRUE(described$one_seed)
  if (own_implementation) {
    check_no_workers(num_workers, call)
    own <- if_supported(
      make(num_envs %||% entry_point_sub_envs, vectorization_mode = "vector_entry_point")
    )
    if (!is.null(own)) {
      return(list(env = own))
    }
  }
  # Sub-environments with their own seeds. A vector implementation does not use workers.
  make_seeded <- function(n, workers) {
    make(
      n, num_workers = workers, autoreset_mode = "SameStep",
      vectorization_mode = if (own_implementation || is.null(described)) "sync"
    )
  }
  full <- num_envs %||% count_sub_envs(observation_bytes(described$observation_space))
  # There are no more sub-environments than episodes. Without a number the server chooses the
  # workers.
  workers <- num_workers %||% if (max_envs < few_episodes) 0L
  env <- if (!is.null(num_envs)) {
    # A single environment steps in half the time of one with a single sub-environment.
    if (num_envs == 1 && is.null(num_workers)) make(NULL) else make_seeded(num_envs, workers)
  }
  for (n in if (is.null(num_envs)) counts_to_try(min(max_envs, full))) {
    env <- env %||% if_supported(make_seeded(n, if (!is.null(workers)) min(workers, n)))
  }
  list(env = env %||% make(NULL), batch_size = episodes_of_batch(full))
}

# The server may refuse this many; then try fewer.
counts_to_try <- function(n) {
  unique(c(n, Filter(function(fewer) fewer > 1 && fewer < n, c(n %/% 4, fewest_sub_envs))))
}

check_no_workers <- function(num_workers, call) {
  if (isTRUE(num_workers > 0)) {
    abort_wrong("num_workers", num_workers, call,
                "`num_workers = {num_workers}` has no effect on an environment with its own vector
                 implementation, which plays all sub-environments in one process.",
                i = "Leave it out.")
  }
}

# Codes of errors that may disappear with fewer sub-environments or none.
fewer_sub_envs_codes <- c("not_supported", "too_much_memory", "unsupported_space")

# Evaluates code that makes an environment. Returns NULL if the server cannot make such
# sub-environments, or not so many.
if_supported <- function(code) {
  tryCatch(code, gym_error_http = function(cnd) {
    if (!isTRUE(cnd$code %in% fewer_sub_envs_codes)) rlang::cnd_signal(cnd)
  })
}

# A server describes an environment given by its id, its spaces and its limits, without making an
# instance.

#' Describe an environment whose episodes the server plays itself
#'
#' The server is asked once for each environment.
#' @param env_id,num_envs,frames,client As for [as_vector_env()].
#' @param arguments The arguments of the environment, a list.
#' @return As [as_vector_env()], without the functions that play, and with `description`, a list:
#'   `fields`, JSON texts by which a request names the environment; `group`, the number of episodes
#'   that share a seed if all sub-environments have one generator (or `NULL`); `processes`, the
#'   number of processes that play; `needs_max_steps`, whether an episode may go on forever;
#'   `versions` and `processor`. `NULL` if R plays the episodes: for an environment in R or an
#'   object, with frames, with wrappers that are R functions or remember earlier episodes, with
#'   arguments about sub-environments, or with a `num_envs` that the group does not have.
#' @noRd
describe_env <- function(env_id, arguments, client, num_envs = NULL, frames = FALSE,
                         call = rlang::caller_env()) {
  given <- given_id(env_id)
  played_here <- frames || is.null(given) || given$registered || given$calls_r ||
    length(given$remembers) || any(names(arguments) %in% how_made)
  if (played_here) {
    return(NULL)
  }
  check_client(client, call = call)
  described <- known_description(client, env_id, arguments, call)
  other_size <- isTRUE(described$one_seed) && !is.null(num_envs) && num_envs != described$num_envs
  if (is.null(described) || other_size) {
    return(NULL)
  }
  described$num_envs <- as.integer(num_envs %||% described$num_envs)
  described$batch_size <- episodes_of_batch(described$num_envs)
  described
}

# The server's description of an environment, `NULL` if the server does not play it itself.
known_description <- function(client, env_id, arguments, call) {
  described <- client_state(client)$described
  key <- rlang::hash(list(env_id, if (length(arguments)) arguments))
  described[[key]] <- described[[key]] %||%
    list(ask_description(client, env_id, arguments, call))
  described[[key]][[1L]]
}

ask_description <- function(client, env_id, arguments, call) {
  given <- given_id(env_id)
  wrappers <- given$wrappers
  fields <- c(
    env_id = json_string(given$id), kwargs = if (length(arguments)) to_json(arguments),
    wrappers = if (length(wrappers)) wrappers_json(wrappers)
  )
  answer <- tryCatch(
    withCallingHandlers(
      post_answer(client, rollouts_route, fields, repeatable = TRUE, call = call),
      gym_error_http_400 = function(cnd) explain_unknown_argument(cnd, names(arguments), call)
    ),
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% c("not_supported", "too_many_processes"))) rlang::cnd_signal(cnd)
    }
  )
  warn_as_gymnasium(answer)
  if (is.null(answer) || length(answer$remembers)) {
    return(NULL)
  }
  observed <- read_space(answer, "observation_space")
  observed$names <- observation_names(answer$env_id, observed, wrapper_names(wrappers))
  num_envs <- answer$group %||% count_sub_envs(observation_bytes(observed))
  spec <- read_spec(answer$env_id, answer$spec)
  vector_env <- new_vector_env(
    observed, read_space(answer, "action_space"),
    c(spec, list(wrappers = wrapper_names(wrappers), kwargs = arguments)),
    num_envs, episodes_of_batch(num_envs), one_seed = !is.null(answer$group), client = client,
    description = list(
      fields = fields, group = answer$group, processes = answer$processes %||% 1L,
      needs_max_steps = answer$needs_max_steps %||% is.null(answer$spec$max_episode_steps),
      versions = answer$versions, processor = shown_line(answer$processor)
    )
  )
  # play_requests() notes here how many episodes the last request had.
  vector_env$known <- new.env(parent = emptyenv())
  vector_env
}

rollouts_route <- "/v1/rollouts/"
