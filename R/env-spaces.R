#' Get an environment's spaces
#'
#' `env_action_space_info()` returns the action space, `env_observation_space_info()` the
#' observation space.
#'
#' @inheritParams env_reset
#' @return A space: a list with the element `name` and, for Discrete, `n` (the number of values) and
#'   `start` (the first of them), for Box, `shape`, `dtype`, `low` and `high`, the bounds row by
#'   row, which may be infinite. For the other kinds see [space_sample()]. A vector environment
#'   returns the space of all sub-environments together: a Box of shape 4 becomes a Box of shape
#'   `c(n, 4)`, a Discrete space becomes a MultiDiscrete space of shape `n`. The parts of a Tuple or
#'   Dict change in the same way. Other spaces become a Tuple with a space for each sub-environment.
#' @section Errors: `gym_error_http_400` for an unknown instance, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' client <- gym_client()
#' instance_id <- env_create(client, "CartPole-v1")
#' env_action_space_info(client, instance_id)
#' env_observation_space_info(client, instance_id)$high
#' env_close(client, instance_id)
env_action_space_info <- function(x, instance_id) {
  instance_space(known_instance(x, instance_id), "action_space")
}

#' @rdname env_action_space_info
#' @export
env_observation_space_info <- function(x, instance_id) {
  instance_space(known_instance(x, instance_id), "observation_space")
}

#' Draw a random action
#'
#' The server draws an action from the environment's action space, with a generator that has the
#' environment's seed.
#'
#' @inheritParams env_reset
#' @return An action for [env_step()]: a whole number for Discrete, a numeric vector or array for
#'   Box. [space_sample()] lists all kinds. A vector environment returns an action for each
#'   sub-environment.
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
  read_values(decode_sample(instance, answer$action), "Its `action`")
}

#' Check whether a value belongs to a space
#'
#' The action space of an environment is the set of its actions, and the observation space that of
#' its observations. In CartPole the actions are 0 and 1, so 2 does not belong to its action space.
#'
#' @inheritParams env_reset
#' @param action,observation The value to check: any R object.
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
  instance_contains(x, instance_id, "action_space", action)
}

#' @rdname env_action_space_contains
#' @export
env_observation_space_contains <- function(x, instance_id, observation) {
  instance_contains(x, instance_id, "observation_space", observation)
}

instance_contains <- function(x, instance_id, which, value, call = rlang::caller_env()) {
  instance <- known_instance(x, instance_id, call = call)
  single <- instance[[paste0("single_", which)]]
  num_envs <- instance$num_envs
  space <- sent_space(single, num_envs)
  if (!fits_space(space, value)) {
    return(FALSE)
  }
  single_one <- is.null(num_envs)
  json <- if (single_one) write_value(space, value) else write_batch(single, value, num_envs)
  route <- paste0(instance$route, which, "/contains")
  isTRUE(post_answer(x, route, c(value = json), call = call)$member)
}

# Environments named by their id ----------------------------------------------------

#' Find the spaces of an environment
#'
#' If the environment is given by its id, this makes it and closes it.
#' @return A list: `observation_space` and `action_space`, those of a single sub-environment, and
#'   `spec`.
#' @noRd
known_spaces <- function(env, client, call = rlang::caller_env()) {
  check_environment(env, call = call)
  if (!is.null(given_id(env))) {
    env <- gym_make(env, client = client)
    on.exit(close_quietly(env))
  }
  list(
    observation_space = env$single_observation_space %||% env$observation_space,
    action_space = env$single_action_space %||% env$action_space, spec = env$spec
  )
}

# Closes an environment and ignores errors: an error before closing is more useful than one from
# closing.
close_quietly <- function(env) tryCatch(env$close(), gym_error = function(cnd) NULL)

check_environment <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  named <- rlang::is_string(x) && !is.na(x) && nzchar(x)
  # Is there a method of `as_vector_env()` for the object's own class?
  has_method <- function(class) {
    !is.null(utils::getS3method("as_vector_env", class, optional = TRUE))
  }
  if (!named && !is_playable(x) && !(is.object(x) && any(vapply(.class2(x), has_method, NA)))) {
    must <- "the id of an environment or an environment made by `gym_make()`"
    hint <- if (inherits(x, c("gym_training", "gym_rollout")) && length(x$env_id)) {
      paste0("The environment comes first, then what plays in it: `\"", x$env_id,
             "\", training`.")
    }
    abort_argument(x, must, arg, call, hint)
  }
  invisible(x)
}

is_playable <- function(x) {
  (is.environment(x) || is.list(x)) && is.function(x$reset) && is.function(x$step)
}
