# The classic calls: one function for each route of the server.

#' Create an environment on a server
#'
#' Make an instance of an environment. The server keeps the instance until [env_close()] or the end
#' of the session.
#'
#' @param x A client, made by [create_GymClient()], [gym_client()] or [gym_server_start()].
#' @param env_id The environment's id, a string such as `"CartPole-v1"`, or the result of
#'   [gym_wrap()]. [env_registry()] lists the ids.
#' @param seed The seed of the first reset (unless [env_reset()] gets one) and of action sampling: a
#'   whole number of at least 0, or `NULL` for a random seed. A vector environment also accepts one
#'   seed for each sub-environment, see [env_reset()].
#' @param render_mode `"rgb_array"` for frames, or `"human"` to watch: this also opens a page that
#'   shows the environment in real time, see [env_watch()]. `NULL`, the default, uses frames if the
#'   environment can draw them. The server draws them only when [env_render()] asks for one or
#'   somebody watches.
#' @param num_envs The number of sub-environments of a vector environment, a whole number of at
#'   least 1. Sub-environments are copies of the environment that are reset and stepped together.
#'   Each has its own row in observations and actions, even if there is only one. The server's limit
#'   is 100,000. `NULL`, the default, makes a single environment.
#' @param kwargs A named list of further arguments for the environment, such as `list(gravity = -5)`
#'   for LunarLander or `list(map_name = "8x8")` for FrozenLake. `list(max_episode_steps = 1000)`
#'   sets another step limit for any environment; -1 removes it. A vector of length one is sent as a
#'   single value; wrap it in `I()` to send a list of one.
#' @param wrappers A list of wrappers, applied in this order. Each is a list of the wrapper's name,
#'   a string, and its arguments by name, such as `list("TimeLimit", max_episode_steps = 50)`.
#'   [gym_wrap()] builds such a list with a pipe.
#' @param vectorization_mode How the sub-environments run. `"vector_entry_point"` uses the
#'   environment's own vector implementation, if it has one. CartPole has one, which is the fastest
#'   way from about eight sub-environments. `"sync"` runs them one after the other in the server's
#'   process. `"async"` runs groups of them in worker processes, which is worthwhile if a step takes
#'   long. `"sync"` and `"async"` give the same results. `NULL`, the default, uses the environment's
#'   own implementation if that supports the other arguments; otherwise `num_workers` decides.
#'   Requires `num_envs`.
#' @param autoreset_mode What happens to a sub-environment after the end of its episode.
#'   `"NextStep"`: the next step resets it and ignores its action and reward. `"SameStep"`: the same
#'   step resets it, and its last observation is in the info, see [env_step()]. `"Disabled"`: call
#'   [env_reset()] with a `mask` before it steps again. `NULL`, the default, is `"NextStep"`.
#'   Requires `num_envs`.
#' @param name A name of your choice, a string of at most 100 printable characters. [env_list()]
#'   shows it to all users of the server. `NULL`, the default, for no name.
#' @param num_workers The number of worker processes for the sub-environments, a whole number: 0 is
#'   `"sync"`, more is `"async"`. The results do not depend on it. `NULL`, the default, lets the
#'   server choose: none if steps are fast, otherwise at most the number of cores that it may use.
#'   Requires `num_envs`, which is also the largest number allowed. Not for `"vector_entry_point"`.
#' @return The instance's id, a string of 8 hexadecimal digits.
#' @section Errors:
#' * `gym_error_http_400` for an unknown id (the hint lists similar ones), for arguments that the
#'   environment does not have (code `invalid_kwargs`), for a forbidden wrapper (code
#'   `wrapper_not_allowed`; the hint lists the allowed ones), for a `vectorization_mode` that does
#'   not support the other arguments or worker processes that cannot make the environment (code
#'   `not_supported`; the hint names alternatives), or if a part of the server is not installed
#'   (code `missing_dependency`; the hint says how to install it).
#' * `gym_error_http_429` for more sub-environments than the server allows (code
#'   `too_many_sub_envs`), if it has no room for more environments or processes (codes
#'   `too_many_instances`, `too_many_processes`), or if the system gives the
#'   server no more memory (code `too_much_memory`; see `max_memory_mb` of [gym_server_start()]).
#' * `gym_error_http_504` if making it in worker processes takes longer than the server allows (code
#'   `call_too_long`).
#' * `gym_error_argument`; `gym_error_connection`.
#'
#' The server removes an environment if a call hangs in its worker processes, or if nobody has used
#' or watched it for a day; see `max_call_seconds` and `idle_minutes` of [gym_server_start()]. Every
#' later call then raises `gym_error_http_504` with code `call_too_long`, or `gym_error_http_410`
#' with code `instance_idle_closed`. A call that hangs elsewhere ends the server. If a worker
#' process has ended, later calls raise `gym_error_http_500` with code `environment_died`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1", seed = 1)
#' env_list_all(client)
#' env_close(client, instance_id)
#'
#' # Three poles at once, each with its seed.
#' three <- env_create(client, "CartPole-v1", seed = 1:3, num_envs = 3)
#' env_reset(client, three)
#' env_step(client, three, c(1, 0, 1))$reward
#' env_close(client, three)
env_create <- function(x, env_id, seed = NULL, render_mode = NULL, num_envs = NULL,
                       kwargs = list(), wrappers = list(), vectorization_mode = NULL,
                       autoreset_mode = NULL, name = NULL, num_workers = NULL) {
  check_client(x)
  check_not_registered(env_id)
  check_named_list(kwargs)
  kwargs <- with_random_map(env_id, kwargs, seed)
  create_instance(
    x, env_id, seed, render_mode, kwargs, wrappers, num_envs, vectorization_mode, autoreset_mode,
    name, num_workers
  )
}

#' List the environments running on a server
#'
#' [env_list()] also returns their names, age and last use. [env_registry()] lists the environments
#' that you can make.
#'
#' @inheritParams env_create
#' @return A named list of environment ids, strings, with the instance ids as names. It contains the
#'   environments of all clients of the server.
#' @section Errors: `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env_list_all(gym_client())
env_list_all <- function(x) {
  check_client(x)
  close_queued(x)
  lapply(get_answer(x, "/v1/envs/")$all_envs, shown_line)
}

#' Start a new episode
#'
#' Reset an environment before its first step and after the end of each episode. A vector
#' environment itself resets each sub-environment after the end of its episode, unless the autoreset
#' mode is `"Disabled"`.
#'
#' @inheritParams env_create
#' @param instance_id An instance's id, as returned by [env_create()].
#' @param seed The seed of the environment and of action sampling: a whole number from 0 to 2^53.
#'   `NULL` continues the current generator. In a vector environment, one number is the seed of the
#'   first sub-environment; the second gets this number plus 1, and so on. If the environment's own
#'   implementation has one generator for all sub-environments, the number is its seed. You can also
#'   give one number for each sub-environment, or `NA` to continue its generator.
#' @param options A named list of options for the environment's reset, such as
#'   `list(low = -0.1, high = 0.1)` for CartPole.
#' @param return_info Also return the environment's info? `TRUE` or `FALSE`, the default.
#' @param mask For a vector environment: which sub-environments to reset, a logical vector with an
#'   element for each of them, at least one `TRUE`. `NULL`, the default, resets all. To use a mask,
#'   make the environment with `vectorization_mode = "sync"`: of the environments' own vector
#'   implementations, only that of the Atari games supports one.
#' @return The first observation, in the form of the observation space: a numeric vector for a Box
#'   of one dimension, an array for one of more, an integer for Discrete. [space_sample()] lists all
#'   kinds. With `return_info = TRUE` a list of `observation` and `info`.
#'
#'   A vector environment returns the observations of all sub-environments together. A Box of one
#'   dimension becomes a matrix with a row for each sub-environment, a Box of more an array whose
#'   first dimension is the sub-environment. Discrete and Text become a vector with an element for
#'   each. Tuple and Dict become a list whose parts have this form; Sequence, Graph and OneOf a list
#'   with an element for each. Numbers are integers if all of them fit. Each element of the info
#'   also has an entry for each sub-environment, `NA` (in a list `NULL`) for a sub-environment
#'   without a value.
#'
#'   An `info` is a named list. It is sent without types: an array of plain values of one kind
#'   becomes a vector, an array of equally long arrays a matrix (and so on), and any other array a
#'   list. So an array of one number looks like the number itself. The texts "NaN", "Infinity" and
#'   "-Infinity" look like these numbers unless other text is beside them. An integer beyond 2^53
#'   arrives as text.
#' @section Errors: `gym_error_http_400` for an unknown instance, and with code `not_supported` for
#'   a `mask` or seeds that the environment's own implementation does not support (`"sync"` and
#'   `"async"` do). `gym_error_http_500` for an error inside the environment. `gym_error_argument`,
#'   also for a `mask` or `seed` with a length other than the number of sub-environments.
#'   `gym_error_connection`. The environment is unchanged, except perhaps after an error inside it.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_reset(client, instance_id, seed = 1)
#' str(env_reset(client, instance_id, return_info = TRUE))
#' env_close(client, instance_id)
env_reset <- function(x, instance_id, seed = NULL, options = NULL, return_info = FALSE,
                      mask = NULL) {
  check_flag(return_info)
  reset_instance(known_instance(x, instance_id), seed, options, return_info, mask)
}

#' Take one step
#'
#' Take an action and move the environment on by one time step. Call [env_reset()] after the last
#' step of an episode. Further steps are passed to the environment, with one warning per episode.
#'
#' A vector environment takes an action for each sub-environment. `autoreset_mode` decides what
#' happens after the end of an episode, see [env_create()]. With the default, `"NextStep"`, the next
#' step ignores the action, resets the sub-environment and returns its first observation, the reward
#' 0 and neither `terminated` nor `truncated`.
#'
#' @inheritParams env_reset
#' @param action An action of the action space: a whole number for Discrete (or its meaning, such as
#'   `"push left"`, if the printed environment shows meanings), a numeric vector or array for Box.
#'   If its numbers have names, these must be the documented ones, such as `"main engine"`, or those
#'   of a table of steps, such as `"action_1"`, in any order. [space_sample()] lists all kinds. A
#'   vector environment takes one action for each sub-environment, in the form of the observations
#'   of [env_reset()]: a vector for Discrete, a matrix with a row for each for a Box of one
#'   dimension.
#' @param render Show the environment? `TRUE` or `FALSE`, the default. The first `TRUE` opens the
#'   environment's page, see [env_watch()]. While somebody watches, each step with `TRUE` takes real
#'   time. [env_render()] returns a frame.
#' @param which For a vector environment: the numbers of the sub-environments to step, from 1 and in
#'   increasing order. `action` and the result then have rows for these only. `NULL`, the default,
#'   steps all. To use `which`, make the environment with `vectorization_mode = "sync"`: an
#'   environment's own vector implementation always steps all.
#' @return A list of
#'   * `observation`, as from [env_reset()],
#'   * `reward`, a number,
#'   * `done`, whether the episode has ended: `terminated || truncated`,
#'   * `info`, a list of further information from the environment, see [env_reset()],
#'   * `terminated`, whether the episode ended by the environment's own rules,
#'   * `truncated`, whether it was cut off, for example by a step limit.
#'
#'   In a vector environment `reward` is a numeric vector, and `done`, `terminated` and `truncated`
#'   are logical vectors, with an element for each sub-environment that stepped. The additional
#'   element `next_observation` has the observations that the step led to, in the form of
#'   `observation`. The two differ only with autoreset mode `"SameStep"`: at the end of an episode,
#'   `next_observation` is the last observation of this episode, and `observation` is the first one
#'   of the next episode. The info then also has `final_obs`, a list with the last observation of
#'   each sub-environment whose episode ended, `NULL` for the others.
#' @section Errors:
#' * `gym_error_space` for an action that does not fit the action space; the environment is
#'   unchanged. In a vector environment also for a wrong number of actions. The message names the
#'   sub-environment: by its number from 1, or, if the server refuses the action, by its index from
#'   0, such as `[2]` for the third. A Box action outside its bounds is not an error: the
#'   environment gets it, as in Gymnasium, and most environments clip it.
#' * `gym_error_argument` for an invalid `which`.
#' * `gym_error_http_400` with code `reset_needed` before the first reset, or after the end of an
#'   episode if `autoreset_mode` is `"Disabled"` (the message counts sub-environments from 0), and
#'   with code `not_supported` for `which` if all must step together.
#' * `gym_error_http_500` for an error inside the environment; `gym_error_connection`.
#' @section Warnings: `gym_warning_step_after_done`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_reset(client, instance_id, seed = 1)
#' str(env_step(client, instance_id, 1))
#' env_close(client, instance_id)
#'
#' three <- env_create(client, "CartPole-v1", num_envs = 3, vectorization_mode = "sync")
#' env_reset(client, three, seed = 1)
#' str(env_step(client, three, c(1, 0, 1)))
#' env_step(client, three, c(0, 1), which = c(1, 3))$observation
#' env_close(client, three)
env_step <- function(x, instance_id, action, render = FALSE, which = NULL) {
  instance <- known_instance(x, instance_id)
  if (!isFALSE(render)) {
    check_flag(render)
    watch_once(instance)
  }
  step_instance(instance, action, which, render)
}

#' Close an environment
#'
#' Remove the instance from the server. If it has a monitor, this ends the monitor, too.
#'
#' @inheritParams env_reset
#' @return Nothing, invisibly.
#' @inheritSection env_action_space_info Errors
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_close(client, instance_id)
env_close <- function(x, instance_id) {
  check_client(x)
  check_string(instance_id)
  if (is.null(end_of_named(x, instance_id))) close_instance(x, instance_id)
  invisible()
}

#' Upload results to OpenAI Gym
#'
#' OpenAI's service closed in 2017. This function always raises an error, so that old scripts fail
#' with a clear reason.
#'
#' @inheritParams env_create
#' @param training_dir The directory of a monitor's results, a string.
#' @param api_key,algorithm_id The key for the service, by default from the environment variable
#'   `OPENAI_GYM_API_KEY`, and a name for the algorithm.
#' @return It does not return.
#' @section Errors: `gym_error_http_410`, because the service is closed. `gym_error_http_400` if
#'   `training_dir` or the key is missing.
#' @export
#' @examplesIf gym:::can_start_server()
#' try(upload(gym_client(), "results", api_key = "none"))
upload <- function(x, training_dir, api_key = NULL, algorithm_id = NULL) {
  check_client(x)
  check_string(training_dir)
  post_answer(x, "/v1/upload/", json_texts(list(
    training_dir = training_dir,
    api_key = api_key %||% Sys.getenv("OPENAI_GYM_API_KEY"),
    algorithm_id = algorithm_id
  )))
  invisible()
}

#' Stop a server
#'
#' The server finishes running calls, closes all environments and stops. To stop a server of this
#' session, you can also use [gym_server_stop()].
#'
#' @inheritParams env_create
#' @return Nothing, invisibly.
#' @section Errors: `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' server <- gym_server_start()
#' shutdown_server(server)
shutdown_server <- function(x) {
  check_client(x)
  post_answer(x, "/v1/shutdown/")
  invisible()
}
