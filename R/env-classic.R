# The classic calls: one function for each route of the server.

#' Create an environment on a server
#'
#' Makes an instance of an environment; the server keeps it until [env_close()] or the end of
#' the session that made it.
#'
#' @param x A client, made by [create_GymClient()], [gym_client()] or
#'   [gym_server_start()].
#' @param env_id The environment's id, a string such as `"CartPole-v1"`, or what
#'   [gym_wrap()] made of one. [env_registry()] lists the ids.
#' @param seed Seed of the first reset, unless that is given one, and of the sampling
#'   of actions: a whole number of at least 0, `NULL` for a random one. For a vector
#'   environment also one for each sub-environment, see [env_reset()].
#' @param render_mode `"rgb_array"` for pictures, or `"human"` for an environment that
#'   people want to see: the same pictures, and its page opens, on which it moves in real
#'   time, see [env_watch()]. `NULL`, the default, takes pictures where the environment
#'   can draw them. They are drawn only when [env_render()] asks for them or while
#'   somebody watches.
#' @param num_envs Makes a vector environment with so many sub-environments, a whole number of
#'   at least 1: copies of the environment that are reset and stepped together, each with a row
#'   of its own in observations and actions, also when there is only one. The server sets a
#'   limit, 16,384 unless it was started with another. `NULL`, the default, makes a single
#'   environment.
#' @param kwargs A named list of further arguments for the environment, such as
#'   `list(gravity = -5)` for LunarLander or `list(map_name = "8x8")` for
#'   FrozenLake. `list(max_episode_steps = 1000)` sets another limit of steps for any
#'   environment, higher or lower than its own, and -1 none. A vector of length one
#'   travels as a single value, wrapped in `I()` as a list of one.
#' @param wrappers A list of wrappers, applied in this order: each a list of the
#'   wrapper's name, a string, and its arguments by name, such as
#'   `list("TimeLimit", max_episode_steps = 50)`. [gym_wrap()] writes such a list
#'   with a pipe.
#' @param vectorization_mode How the sub-environments are run: `"vector_entry_point"`, by the
#'   environment's own implementation, by far the fastest where there is one, as in
#'   CartPole; `"sync"`, one after the other in the server's own process; `"async"`, in groups, each
#'   in a worker process, which pays where a step takes long. `"sync"` and `"async"` behave alike.
#'   `NULL`, the default, takes the environment's own implementation where there is one that does
#'   what is asked for, else lets `num_workers` decide. Only with `num_envs`.
#' @param autoreset_mode What becomes of a sub-environment whose episode has ended:
#'   `"NextStep"`, it is reset by the next step, whose action and reward do not
#'   count; `"SameStep"`, it is reset within the step, and its last observation is in
#'   the info, see [env_step()]; `"Disabled"`, it wants [env_reset()] with a `mask`
#'   before it steps again. `NULL`, the default, is `"NextStep"`. Only with `num_envs`.
#' @param name What you call it, a string of at most 100 printable characters, by
#'   which [env_list()] shows it to those who share the server; `NULL`, the default,
#'   for no name.
#' @param num_workers How many worker processes run the sub-environments, a whole number: 0 is
#'   `"sync"`, more are `"async"`. What comes of it is the same for any number. `NULL`, the default,
#'   lets the server choose: none where a step of all of them takes little time, else at most as
#'   many as there are cores that it may use. Only with `num_envs`, at most as many as that, and not
#'   with `"vector_entry_point"`.
#' @return The instance's id, a string of 8 hexadecimal digits.
#' @section Errors: `gym_error_http_400` for an id that the server does not
#'   know, with the nearest ones as a hint, for arguments that the environment
#'   does not take (code `invalid_kwargs`), for a wrapper that the server does not
#'   allow (code `wrapper_not_allowed`; the hint lists those that it does), for a
#'   `vectorization_mode` that cannot do what else is asked for, or worker processes in which the
#'   environment cannot be made (code `not_supported`; the hint says what can be done), and when a
#'   part of the server is not installed (code
#'   `missing_dependency`; the hint says how); `gym_error_http_429` for more sub-environments than
#'   the server allows (code `too_many_sub_envs`), when it has as many environments or
#'   processes as it allows (codes `too_many_instances`, `too_many_processes`), or where the
#'   environment would take more memory than is left (code `too_much_memory`);
#'   `gym_error_http_504` when making it takes longer than the server allows a call to take
#'   (code `call_too_long`);
#'   `gym_error_argument`; `gym_error_connection`.
#'
#'   The server evicts an environment on which a call takes too long, and one that nobody
#'   has used or watched for a day, unless it was started with other limits
#'   (`max_call_seconds` and `idle_minutes` of [gym_server_start()]). Every later call
#'   then says so: `gym_error_http_504` with code `call_too_long`, `gym_error_http_410`
#'   with code `instance_idle_closed`; with code `instance_memory_closed` where all environments
#'   together held too much memory (`max_memory_mb`), and this one had grown most. When a process
#'   in which an environment or some of its sub-environments live has ended, it is
#'   `gym_error_http_500` with code `environment_died`.
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
  create_and_watch(
    x, env_id, seed, render_mode, kwargs, wrappers, num_envs, vectorization_mode, autoreset_mode,
    name, num_workers
  )
}

#' List the environments running on a server
#'
#' [env_list()] says more of each; [env_registry()] lists those that could be made.
#'
#' @inheritParams env_create
#' @return A named list: instance id to environment id, both strings. It holds
#'   the environments of all of the server's clients.
#' @section Errors: `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env_list_all(gym_client())
env_list_all <- function(x) {
  check_client(x)
  close_queued(x)
  all_envs <- get_answer(x, "/v1/envs/")$all_envs
  if (!is_object(all_envs) || !all(vapply(all_envs, rlang::is_string, NA))) {
    refuse_field(all_envs, "all_envs", "an object of strings")
  }
  lapply(all_envs, shown_line)
}

#' Start a new episode
#'
#' @inheritParams env_create
#' @param instance_id An instance's id, as [env_create()] returns it.
#' @param seed Seed of the environment and of the sampling of actions: a whole
#'   number from 0 to 2^53; `NULL` goes on with the generator as it is. In a vector environment
#'   one number is for all: the first sub-environment gets it, the second gets it plus 1, and so
#'   on; where the environment's own implementation has one generator for all of them, that gets
#'   it. Or give one number for each sub-environment, `NA` where its generator goes on as it is.
#' @param options A named list of options for the environment's reset, such as
#'   `list(low = -0.1, high = 0.1)` for CartPole.
#' @param return_info Whether to return the environment's info, too: `TRUE` or `FALSE`, the
#'   default.
#' @param mask For a vector environment: which sub-environments to reset, a logical vector with
#'   an element for each of them, at least one of them `TRUE`. `NULL`, the default, resets all.
#'   An environment's own vector implementation takes no mask: make it with
#'   `vectorization_mode = "sync"`.
#' @return The first observation, in the form of the observation space: a
#'   numeric vector for a Box of one dimension, an array for one of more, an
#'   integer for Discrete; [space_sample()] lists all kinds. With
#'   `return_info = TRUE` a list of `observation` and `info`.
#'
#'   In a vector environment the observations of all sub-environments together: for a Box of one
#'   dimension a matrix with a row for each sub-environment, for a Box of more an array whose first
#'   dimension counts the sub-environments, for Discrete and Text a vector with an element for
#'   each, for Tuple and Dict a list in which each part has this form, and for Sequence, Graph and
#'   OneOf a list with an element for each. Numbers are integer where those of all sub-environments
#'   fit. In the info, too, each element has an entry for each sub-environment, `NA` (in a list
#'   `NULL`) for one that has no value.
#'
#'   An `info` is a list with names. It travels without types: an array of plain
#'   values of one kind becomes a vector, an array of equally long arrays a matrix
#'   (and so on), another a list. So an array of one number cannot be told from
#'   the number, nor the texts "NaN", "Infinity" and "-Infinity" from these numbers
#'   unless there is other text beside them; an integer beyond 2^53 arrives as text.
#' @section Errors: `gym_error_http_400` for an unknown instance, and with code
#'   `not_supported` for a `mask` or a seed for each sub-environment where the environment's own
#'   implementation cannot do that (`"sync"` and `"async"` can); `gym_error_http_500` for an error
#'   inside the environment; `gym_error_argument`, also for a `mask` or `seed` whose
#'   length is not the number of sub-environments; `gym_error_connection`. Nothing has moved,
#'   except perhaps after an error inside an environment.
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
#' Takes an action, which moves the environment on by one time step. After the
#' last step of an episode the environment wants [env_reset()]; stepping on is
#' left to the environment and warned of once an episode.
#'
#' In a vector environment it takes an action for each sub-environment, and moves each on. What
#' becomes of one whose episode has ended depends on `autoreset_mode`, see [env_create()]: by
#' default, `"NextStep"`, this step resets it, takes no action in it and returns its new first
#' observation, the reward 0 and neither `terminated` nor `truncated`.
#'
#' @inheritParams env_reset
#' @param action An action of the action space: a whole number for Discrete (or what it means, such
#'   as `"push left"`, where the printed environment says that), a
#'   numeric vector or array for Box; [space_sample()] has the table of all kinds.
#'   In a vector environment one for each sub-environment, in the form in which [env_reset()]
#'   returns observations: a vector for Discrete, for a Box of one dimension a matrix with a row
#'   for each.
#' @param render Whether people want to see it: `TRUE` or `FALSE`, the default. The first
#'   `TRUE` opens the environment's page, see [env_watch()], and while somebody watches
#'   there each such step waits for real time. [env_render()] fetches a picture.
#' @param which For a vector environment: the numbers of the sub-environments that are to step,
#'   counted from 1 and in increasing order; `action` and what is returned then have rows for
#'   these alone. `NULL`, the default, steps all. An environment's own vector implementation always
#'   steps all: make it with `vectorization_mode = "sync"`.
#' @return A list of
#'   * `observation`, as from [env_reset()],
#'   * `reward`, a number,
#'   * `done`, whether the episode has ended: `terminated || truncated`,
#'   * `info`, a list of further information from the environment, see [env_reset()],
#'   * `terminated`, whether the episode ended by the environment's own rules,
#'   * `truncated`, whether it was cut off, such as by its limit of steps.
#'
#'   In a vector environment `reward` is a numeric vector and `done`, `terminated` and `truncated`
#'   are logical vectors, with an element for each sub-environment that stepped. There is one more
#'   element, `next_observation`: what the step led to, in the form of `observation`. It differs
#'   from that only with autoreset mode `"SameStep"`: where an episode has ended it is the last
#'   observation of that, and `observation` the first of the next one. The info then has
#'   `final_obs`, too: a list with the last observation of each sub-environment whose episode ended,
#'   `NULL` for the others.
#' @section Errors: `gym_error_space` for an action that does not fit the action
#'   space, the environment has not moved then; a Box action outside of the bounds goes to
#'   the environment, as in Gymnasium, and most clip it. In a vector environment also for a wrong
#'   number of actions, and the message names the sub-environment whose action does not fit: by its
#'   number from 1, or where the server refuses it by its index from 0, such as `[2]` for the
#'   third. `gym_error_argument` for a `which` that picks no sub-environments. `gym_error_http_400`
#'   with code `reset_needed` before the first reset, or when the episode of a sub-environment that
#'   is to step has ended and `autoreset_mode` is `"Disabled"` (the message counts
#'   sub-environments from 0), and with code `not_supported` for `which` where all must step
#'   together;
#'   `gym_error_http_500` for an error inside the environment; `gym_error_connection`.
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
  check_flag(render)
  instance <- known_instance(x, instance_id)
  if (render && !instance$classic) {
    watch_once(instance)
  }
  step_instance(instance, action, which, render)
}

#' Close an environment
#'
#' Takes the instance off the server, with its monitor if it has one.
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
  close_instance(x, instance_id)
  invisible()
}

#' Upload results to OpenAI Gym
#'
#' OpenAI's service closed in 2017. The function is kept so that an old script
#' fails with a reason: it always raises an error.
#'
#' @inheritParams env_create
#' @param training_dir The directory of a monitor's results, a string.
#' @param api_key,algorithm_id What the service asked for: a key, by default that
#'   of the environment variable `OPENAI_GYM_API_KEY`, and a name for the algorithm.
#' @return It does not return.
#' @section Errors: `gym_error_http_410`, as the service is gone;
#'   `gym_error_http_400` when `training_dir` or the key is missing.
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
#' The server finishes the calls under way, closes all environments and ends.
#' For a server that this session started there is also [gym_server_stop()].
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
  response <- any_response(x, "/v1/shutdown/")
  # The original server answers with plain text instead of JSON.
  if (response$status_code != 200L) {
    read_answer(response, "POST")
  }
  invisible()
}
