#' Wrap an environment before it is made
#'
#' Notes a wrapper of Gymnasium's that the environment is to get when
#' [gym_make()], [env_create()], [rollout()] or [search_random()] make it on the
#' server: a limit of steps, a scale for its actions, a smaller picture. Three wrappers call a
#' function of R, such as one that shapes rewards, see below. With the
#' pipe several are written in the order in which they are applied. Nothing is
#' made yet. The spaces that R sees are the wrapped environment's. The environment's own limit
#' of steps stays inside of a `"TimeLimit"`, which can only lower it:
#' `gym_make("MountainCar-v0", max_episode_steps = 1000)` raises it.
#'
#' # Functions of R
#'
#' These wrappers call your function in each step, around environments of Gymnasium and around those
#' written in R:
#' * `"TransformReward"`: `func` returns the new rewards. It gets `reward`, and whatever else its
#'   arguments name of `observation` (on which the action was taken), `action`, `next_observation`,
#'   `terminated` and `truncated`. The environment's `reward_threshold` is dropped, as it is about
#'   other rewards.
#' * `"TransformObservation"`: `func` gets `observation` and returns the new observations;
#'   `observation_space` is their space, where it is another one.
#' * `"TransformAction"`: `func` gets `action`, perhaps `observation` as well, and returns the
#'   actions for the environment; `action_space` is the space of those it gets, where it is another
#'   one.
#'
#' `func` gets batches, also where there is one environment: of rewards a vector, of observations
#' what a policy gets, such as a matrix with a row for each (see [act()]), and returns as many
#' values. Its only argument may have any name. It should depend on its arguments alone.
#'
#' Around Gymnasium's environments R plays step by step (see [rollout()]), which takes longer than
#' playing on the server, and learners of tables play instead of sampling from a model. The server's
#' wrappers come first, inside. An environment of [gym_make()] can be wrapped, too: the result is
#' the same instance with other rewards, observations or actions. The classic calls know nothing of
#' these wrappers.
#'
#' # Environments written in R
#'
#' An environment made by [gym_env()] or of a class that inherits from [GymEnv] is wrapped at once,
#' and what comes back is a new environment of the same functions. An id that [gym_register()] made
#' known is wrapped when it is made. Beside the three above there are seven wrappers for them, with
#' the arguments and the formulas of Gymnasium's:
#' * `"TimeLimit"`: `max_episode_steps`, after how many steps an episode is cut off;
#' * `"ClipAction"`: takes every action of a Box to its bounds;
#' * `"RescaleAction"`: `min_action` and `max_action`, the bounds of the actions from outside;
#' * `"RescaleObservation"`: `min_obs` and `max_obs`, the bounds of the observations from outside;
#' * `"ClipReward"`: `min_reward` and `max_reward`, of which one may be left out;
#' * `"NormalizeObservation"`: `epsilon`, 1e-8 by default; observations minus their mean so far,
#'   divided by their standard deviation so far;
#' * `"NormalizeReward"`: `gamma`, 0.99, and `epsilon`, 1e-8 by default; rewards divided by the
#'   standard deviation so far of their discounted sum.
#'
#' The last two remember earlier episodes, those of one [rollout()] or search. In a vectorised
#' environment they take all sub-environments together, without those whose episode has ended.
#'
#' @param env_id The environment's id, a string such as `"CartPole-v1"`, or what
#'   `gym_wrap()` returned for one; an environment written in R; or for a function of R one made by
#'   [gym_make()].
#' @param wrapper The wrapper's name, a string such as `"TimeLimit"`. Which there
#'   are is the server's choice; the error for one that it does not know lists
#'   them. Their arguments are in
#'   [Gymnasium's documentation](https://gymnasium.farama.org/api/wrappers/).
#' @param ... The wrapper's arguments, by name. A vector of length one travels as
#'   a single value, wrapped in `I()` as a list of one.
#' @return Of an id, an object of class `gym_wrapped`, which prints in one line: a list of
#'   `env_id` and `wrappers`. Of an environment, another one.
#' @section Errors: `gym_error_argument`, also for a wrapper or an argument that there is not for
#'   environments written in R, and for a wrapper of the server's over one that calls a function of
#'   R; the server's come when the environment is made, see [env_create()]. `gym_error_wrapper`,
#'   while it is played, where `func` raises an error (with that error's classes) or returns
#'   something wrong.
#' @section Warnings: `gym_warning_wrapper` where `func` gives a row another value when it is alone
#'   than among others, as `observation[1]` in the place of `observation[, 1]` does.
#' @export
#' @examples
#' wrapped <- "CartPole-v1" |>
#'   gym_wrap("TimeLimit", max_episode_steps = 50) |>
#'   gym_wrap("NormalizeReward")
#' wrapped
#'
#' @examplesIf gym:::can_start_server()
#' env <- wrapped |> gym_make(seed = 1)
#' env$reset()
#' env$close()
#'
#' # A car that is paid for being fast.
#' fast <- "MountainCar-v0" |>
#'   gym_wrap("TransformReward", func = function(reward, next_observation) {
#'     reward + 10 * abs(next_observation[, "velocity"])
#'   })
#' rollout(fast, policy_random(), episodes = 10, seed = 1)
gym_wrap <- function(env_id, wrapper, ...) {
  check_string(wrapper)
  kwargs <- list(...)
  check_dots_named(kwargs, "max_episode_steps = 50")
  if (is.environment(env_id) || is.list(env_id) && !inherits(env_id, "gym_wrapped")) {
    if (is_server_env(env_id)) {
      return(wrap_server_env(env_id, wrapper, kwargs, rlang::current_env()))
    }
    check_wrappable(env_id, rlang::current_env())
    return(wrap_r_env(env_id, wrapper, kwargs, rlang::current_env()))
  }
  registered <- is_registered(env_id)
  if (registered) {
    check_r_wrapper(wrapper, rlang::current_env())
  }
  if (wrapper %in% names(transforms)) {
    check_wrapper_arguments(wrapper, kwargs, rlang::current_env())
    asked_parts(wrapper, kwargs$func, rlang::current_env())
  }
  wrapped <- with_wrappers(env_id, list(c(list(wrapper), kwargs)))
  if (!registered) split_wrappers(wrapped$wrappers, rlang::current_env())
  wrapped
}

# An id with further wrappers.
with_wrappers <- function(env_id, wrappers, call = rlang::caller_env()) {
  if (!inherits(env_id, "gym_wrapped")) {
    check_string(env_id, call = call)
    if (!length(wrappers)) {
      return(env_id)
    }
    env_id <- structure(list(env_id = env_id, wrappers = list()), class = "gym_wrapped")
  }
  check_wrappers(wrappers, call)
  env_id$wrappers <- c(env_id$wrappers, wrappers)
  env_id
}

# The wrappers that gym_wrap() has noted for an id.
noted_wrappers <- function(env_id) if (inherits(env_id, "gym_wrapped")) env_id$wrappers

wrapper_names <- function(wrappers) vapply(wrappers, function(wrapper) wrapper[[1L]], "")

# Those of some wrappers whose results depend on earlier episodes.
remembering <- function(names) {
  as.character(intersect(names, c("NormalizeObservation", "NormalizeReward")))
}

#' @export
format.gym_wrapped <- function(x, ...) {
  paste(c(x$env_id, vapply(x$wrappers, wrapper_text, "")), collapse = " |> ")
}

#' @export
print.gym_wrapped <- function(x, ...) {
  cat("<", format(x), ">\n", sep = "")
  invisible(x)
}

wrapper_text <- function(wrapper) {
  text <- function(value) if (inherits(value, "gym_space")) format(value) else describe_value(value)
  values <- vapply(wrapper[-1L], text, "")
  arguments <- paste(names(wrapper)[-1L], values, sep = " = ", recycle0 = TRUE, collapse = ", ")
  paste0(wrapper[[1L]], "(", arguments, ")")
}

check_wrappers <- function(wrappers, call = rlang::caller_env()) {
  if (!is.list(wrappers) || !all(vapply(wrappers, is_wrapper, NA))) {
    must <- "a list of lists such as list(\"TimeLimit\", max_episode_steps = 50)"
    abort_argument(wrappers, must, "wrappers", call)
  }
}

# A wrapper is a list of its name and its arguments, which have names.
is_wrapper <- function(x) {
  is.list(x) && length(x) > 0L && rlang::is_string(x[[1L]]) &&
    (length(x) == 1L || rlang::is_named(x[-1L]))
}

wrappers_json <- function(wrappers) {
  json_array(vapply(wrappers, function(wrapper) {
    kwargs <- wrapper[-1L]
    json_object(c(
      name = json_string(wrapper[[1L]]),
      kwargs = if (length(kwargs)) to_json(kwargs)
    ))
  }, ""))
}
