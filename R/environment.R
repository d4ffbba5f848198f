# The classic calls, one a route of the server, and the environment as an object.

#' Create an environment on a server
#'
#' Makes an instance of an environment; the server keeps it until [env_close()].
#'
#' @param x A client, made by [create_GymClient()], [gym_client()] or
#'   [gym_server_start()].
#' @param env_id The environment's id, a string such as `"CartPole-v1"`.
#' @param seed Seed of the first reset that is given none, and of the sampling
#'   of actions: a whole number of at least 0, `NULL` for a random one.
#' @param render_mode `"rgb_array"` for pictures, `"human"` to say that somebody
#'   wants to watch; `NULL` takes pictures where the environment can draw them.
#'   Pictures are drawn only when [env_render()] asks for them.
#' @param kwargs A named list of further arguments for the environment, such as
#'   `list(gravity = -5)` for LunarLander.
#' @return The instance's id, a string of 8 hexadecimal digits.
#' @section Errors: `gym_error_http_400` for an id that the server does not
#'   know, with the nearest ones as a hint, and for arguments that the
#'   environment does not take; `gym_error_argument`; `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1", seed = 1)
#' env_list_all(client)
#' env_close(client, instance_id)
env_create <- function(x, env_id, seed = NULL, render_mode = NULL, kwargs = list()) {
  check_client(x)
  check_named_list(kwargs)
  create_instance(x, env_id, seed, render_mode, kwargs)
}

#' List the environments on a server
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
  get_answer(x, "/v1/envs/")$all_envs
}

#' Start a new episode
#'
#' @inheritParams env_create
#' @param instance_id An instance's id, as [env_create()] returns it.
#' @param seed Seed of the environment and of the sampling of actions: a whole
#'   number of at least 0; `NULL` goes on with the generator as it is.
#' @param options A named list of options for the environment's reset, such as
#'   `list(low = -0.1, high = 0.1)` for CartPole.
#' @return The first observation, in the form of the observation space: a
#'   numeric vector for a Box of one dimension, an array for one of more, an
#'   integer for Discrete.
#' @section Errors: `gym_error_http_400` for an unknown instance,
#'   `gym_error_http_500` for an error inside the environment,
#'   `gym_error_argument`, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_reset(client, instance_id, seed = 1)
#' env_close(client, instance_id)
env_reset <- function(x, instance_id, seed = NULL, options = NULL) {
  reset_instance(x, known_instance(x, instance_id), seed, options)
}

#' Take one step
#'
#' Takes an action, which moves the environment on by one time step. After the
#' last step of an episode the environment wants [env_reset()]; stepping on is
#' left to the environment and warned of once an episode.
#'
#' @inheritParams env_reset
#' @param action An action of the action space: a whole number for Discrete, a
#'   numeric vector or array for Box.
#' @param render Whether somebody wants to see this step: `TRUE` or `FALSE`, the
#'   default. A step that nobody watches is not drawn.
#' @return A list of
#'   * `observation`, as from [env_reset()],
#'   * `reward`, a number,
#'   * `done`, whether the episode has ended: `terminated || truncated`,
#'   * `info`, a list of what the environment tells besides,
#'   * `terminated`, whether the episode ended by the environment's own rules,
#'   * `truncated`, whether it was cut off, such as by its limit of steps.
#' @section Errors: `gym_error_space` for an action that does not fit the action
#'   space, the environment has not moved then; `gym_error_http_400` with code
#'   `reset_needed` before the first reset; `gym_error_http_500` for an error
#'   inside the environment; `gym_error_connection`.
#' @section Warnings: `gym_warning_step_after_done`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_reset(client, instance_id, seed = 1)
#' str(env_step(client, instance_id, 1))
#' env_close(client, instance_id)
env_step <- function(x, instance_id, action, render = FALSE) {
  check_flag(render)
  step_instance(x, known_instance(x, instance_id), action, render)
}

#' Ask for an environment's spaces
#'
#' `env_action_space_info()` tells which actions an environment takes,
#' `env_observation_space_info()` which observations it gives.
#'
#' @inheritParams env_reset
#' @return A space: a list with the element `name` and, for Discrete, `n` (the
#'   number of values) and `start` (the first of them), for Box, `shape`,
#'   `dtype`, `low` and `high`, the bounds row by row, which may be infinite.
#' @section Errors: `gym_error_http_400` for an unknown instance,
#'   `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_action_space_info(client, instance_id)
#' env_observation_space_info(client, instance_id)$high
#' env_close(client, instance_id)
env_action_space_info <- function(x, instance_id) {
  known_instance(x, instance_id)$action_space
}

#' @rdname env_action_space_info
#' @export
env_observation_space_info <- function(x, instance_id) {
  known_instance(x, instance_id)$observation_space
}

#' Draw a random action
#'
#' Draws from the environment's action space on the server, whose generator is
#' seeded together with the environment.
#'
#' @inheritParams env_reset
#' @return An action that [env_step()] takes.
#' @inheritSection env_action_space_info Errors
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1", seed = 1)
#' env_action_space_sample(client, instance_id)
#' env_close(client, instance_id)
env_action_space_sample <- function(x, instance_id) {
  instance <- known_instance(x, instance_id)
  answer <- get_answer(x, paste0(instance$route, "action_space/sample"))
  decode_value(instance$action_space, answer$action)
}

#' Ask whether a value belongs to a space
#'
#' @inheritParams env_reset
#' @param action,observation The value to look at: anything that could be an
#'   action or an observation.
#' @return `TRUE` or `FALSE`.
#' @inheritSection env_action_space_info Errors
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_action_space_contains(client, instance_id, 1)
#' env_action_space_contains(client, instance_id, 2)
#' env_observation_space_contains(client, instance_id, c(0, 0, 0, 0))
#' env_close(client, instance_id)
env_action_space_contains <- function(x, instance_id, action) {
  space_contains(x, instance_id, "action_space", action)
}

#' @rdname env_action_space_contains
#' @export
env_observation_space_contains <- function(x, instance_id, observation) {
  space_contains(x, instance_id, "observation_space", observation)
}

space_contains <- function(x, instance_id, which, value, call = rlang::caller_env()) {
  instance <- known_instance(x, instance_id, call = call)
  route <- paste0(instance$route, which, "/contains")
  # A space's value of one axis is an array also when that axis has length one.
  if (length(instance[[which]]$shape) > 0L && is.null(dim(value)) && !is.list(value)) {
    value <- I(value)
  }
  post_answer(x, route, list(value = value), call = call)$member
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
#' @param algorithm_id,api_key What the service asked for: a name for the
#'   algorithm and a key, by default that of the environment variable
#'   `OPENAI_GYM_API_KEY`.
#' @return It does not return.
#' @section Errors: `gym_error_http_410`, as the service is gone;
#'   `gym_error_http_400` when `training_dir` or the key is missing.
#' @export
#' @examplesIf gym:::can_start_server()
#' try(upload(gym_client(), "results", api_key = "none"))
upload <- function(x, training_dir, algorithm_id = NULL, api_key = NULL) {
  check_client(x)
  check_string(training_dir)
  post_answer(x, "/v1/upload/", list(
    training_dir = training_dir,
    algorithm_id = algorithm_id,
    api_key = api_key %||% Sys.getenv("OPENAI_GYM_API_KEY")
  ))
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
  post_answer(x, "/v1/shutdown/", list())
  invisible()
}

# Instances ---------------------------------------------------------------------

create_instance <- function(x, env_id, seed, render_mode, kwargs, call = rlang::caller_env()) {
  check_string(env_id, call = call)
  check_string(render_mode, allow_null = TRUE, call = call)
  fields <- c(
    env_id = json_string(env_id),
    seed = encode_seed(seed, call = call),
    render_mode = if (!is.null(render_mode)) json_string(render_mode),
    kwargs = if (length(kwargs)) to_json(kwargs)
  )
  close_abandoned(x)
  post_once(x, "/v1/envs/", fields, call = call)$instance_id
}

instance_route <- function(instance_id) {
  paste0("/v1/envs/", curl::curl_escape(instance_id), "/")
}

close_instance <- function(x, instance_id, call = rlang::caller_env()) {
  post_once(x, paste0(instance_route(instance_id), "close/"), call = call)
  instances <- connection(x)$instances
  if (!is.null(instances[[instance_id]])) {
    rm(list = instance_id, envir = instances)
  }
}

# As close_instance(), for an instance that may be gone already.
close_if_there <- function(x, instance_id, call = rlang::caller_env()) {
  tryCatch(
    close_instance(x, instance_id, call),
    gym_error_http_400 = function(cnd) {
      if (!identical(cnd$code, "unknown_instance")) rlang::cnd_signal(cnd)
    }
  )
}

# What the client knows of an instance; asked of the server once.
known_instance <- function(x, instance_id, call = rlang::caller_env()) {
  check_client(x, call = call)
  check_string(instance_id, call = call)
  instances <- connection(x)$instances
  instances[[instance_id]] %||% (instances[[instance_id]] <- ask_instance(x, instance_id, call))
}

ask_instance <- function(x, instance_id, call) {
  route <- instance_route(instance_id)
  answer <- get_answer(x, route, call = call)
  instance <- new.env(parent = emptyenv())
  instance$id <- instance_id
  instance$route <- route
  instance$reset_route <- paste0(route, "reset/")
  instance$step_route <- paste0(route, "step/")
  instance$action_space <- new_space(answer$action_space)
  instance$observation_space <- new_space(answer$observation_space)
  instance$spec <- list(
    id = answer$env_id,
    reward_threshold = answer$reward_threshold,
    max_episode_steps = answer$max_episode_steps
  )
  instance$done <- FALSE
  instance
}

reset_instance <- function(x, instance, seed, options, call = rlang::caller_env()) {
  fields <- c(seed = encode_seed(seed, call = call), options = encode_options(options, call))
  answer <- post_once(x, instance$reset_route, fields, call = call)
  instance$done <- FALSE
  decode_value(instance$observation_space, answer$observation)
}

step_instance <- function(x, instance, action, render, call = rlang::caller_env()) {
  fields <- c(
    action = encode_value(instance$action_space, action, call),
    render = if (render) "true" else "false"
  )
  answer <- post_once(x, instance$step_route, fields, call = call)
  if (isTRUE(instance$done)) {
    warn_step_after_done(instance, call)
  } else {
    instance$done <- answer$done
  }
  list(
    observation = decode_value(instance$observation_space, answer$observation),
    reward = number_from_json(answer$reward),
    done = answer$done,
    info = info_from_json(answer$info),
    terminated = answer$terminated,
    truncated = answer$truncated
  )
}

warn_step_after_done <- function(instance, call) {
  # NA: done, and said so.
  instance$done <- NA
  rlang::warn(
    c(
      paste0("Instance ", instance$id, " of ", instance$spec$id,
             " took a step after the end of its episode."),
      i = "What comes of it is undefined: reset the environment first."
    ),
    class = "gym_warning_step_after_done",
    call = call
  )
}

encode_seed <- function(seed, call = rlang::caller_env()) {
  if (!is.null(seed)) {
    check_count(seed, min = 0, max = 2^53, call = call)
    if (inherits(seed, "integer64")) as.character(seed) else sprintf("%.0f", seed)
  }
}

encode_options <- function(options, call) {
  if (!is.null(options)) {
    check_named_list(options, call = call)
    to_json(options)
  }
}

check_named_list <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!is.list(x) || (length(x) && !rlang::is_named(x))) {
    abort_argument(x, "a list with names", arg, call)
  }
}

# Environments whose objects were thrown away are closed when the next is made:
# a finalizer may run in the middle of another call and must not start its own.
close_abandoned <- function(x) {
  state <- connection(x)
  abandoned <- state$to_close
  state$to_close <- character()
  for (instance_id in abandoned) {
    close_if_there(x, instance_id)
  }
}

# Environments as objects ---------------------------------------------------------

#' Make an environment
#'
#' Makes an environment that is played with `$reset()` and `$step()`, as
#' Gymnasium's documentation writes it with a dot. Without a `client` it lives
#' on the session's own server, which is started when there is none.
#'
#' @inheritParams env_create
#' @param ... Further arguments for the environment, by name, such as
#'   `sutton_barto_reward = TRUE` for CartPole.
#' @param client A client, by default that of [gym_client()].
#' The environment is closed by `$close()`, or some time after the object itself
#' has been thrown away: keep the object for as long as the environment is played.
#'
#' @return An object of class `gym_env` with
#'   * `$reset(seed = NULL, options = NULL)`: starts an episode and returns the
#'     first observation, as [env_reset()],
#'   * `$step(action)`: takes a step and returns a list, as [env_step()],
#'   * `$render()`: the current frame, as [env_render()],
#'   * `$close()`: takes it off the server,
#'   * `$action_space`, `$observation_space`: the spaces, as
#'     [env_action_space_info()],
#'   * `$spec`: a list of `id`, `reward_threshold` and `max_episode_steps`, the
#'     latter two `NULL` where the environment has none,
#'   * `$client`, `$instance_id`: for the classic calls.
#' @section Errors: As [env_create()]; `gym_error_server_start` when no server
#'   could be started.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' env$reset()
#' str(env$step(1))
#' env$close()
gym_make <- function(env_id, ..., seed = NULL, render_mode = NULL, client = gym_client()) {
  kwargs <- list(...)
  check_named_list(kwargs, arg = "...")
  check_client(client)
  instance_id <- create_instance(client, env_id, seed, render_mode, kwargs)
  env <- NULL
  on.exit(if (is.null(env)) close_if_there(client, instance_id))
  env <- gym_env$new(client, instance_id)
  env
}

gym_env <- R6Class(
  "gym_env",
  cloneable = FALSE,
  lock_class = TRUE,
  public = list(
    client = NULL,
    instance_id = NULL,
    action_space = NULL,
    observation_space = NULL,
    spec = NULL,
    initialize = function(client, instance_id) {
      private$instance <- known_instance(client, instance_id)
      private$pid <- Sys.getpid()
      self$client <- client
      self$instance_id <- instance_id
      self$action_space <- private$instance$action_space
      self$observation_space <- private$instance$observation_space
      self$spec <- private$instance$spec
    },
    reset = function(seed = NULL, options = NULL) {
      reset_instance(self$client, private$instance, seed, options)
    },
    step = function(action) {
      step_instance(self$client, private$instance, action, render = FALSE)
    },
    render = function() {
      env_render(self$client, self$instance_id)
    },
    close = function() {
      if (!private$closed) {
        close_if_there(self$client, self$instance_id)
        private$closed <- TRUE
      }
      invisible(self)
    },
    print = function(...) {
      cat("<gym_env: ", self$spec$id, if (private$closed) ", closed", ">\n", sep = "")
      cat("  observations: ", format(self$observation_space), "\n", sep = "")
      cat("  actions:      ", format(self$action_space), "\n", sep = "")
      invisible(self)
    }
  ),
  private = list(
    instance = NULL,
    pid = NULL,
    closed = FALSE,
    finalize = function() {
      # In a forked child the environment is still the parent's.
      if (!private$closed && identical(private$pid, Sys.getpid())) {
        state <- connection(self$client)
        state$to_close <- c(state$to_close, self$instance_id)
      }
    }
  )
)
