#' Register an environment written in R
#'
#' Register an environment written in R under an id, which [gym_make()], [rollout()], every search
#' and [env_registry()] then accept. It is registered until the end of the session. Registering an
#' id again replaces the environment, even one of Gymnasium.
#'
#' To play several sub-environments together, [rollout()] and searches copy the environment of
#' [gym_env()]. Before each call of `entry_point`, its random generator gets the same seed, so it
#' always makes the same environment. Draw values that should differ between episodes in `reset`.
#'
#' @param id The id, a string of letters, digits and `_.:/-`, such as `"Corridor-v0"`.
#' @param entry_point An environment of [gym_env()], or a function that returns an environment.
#' @param ... Arguments for `entry_point`, by name, which [gym_make()] and [rollout()] can override.
#'   For an environment of [gym_env()], they replace values with which each `self` starts.
#' @param max_episode_steps The number of steps after which an episode is cut off, a whole number.
#'   `NULL`, the default, keeps the environment's own limit.
#' @param reward_threshold The mean return from which the environment counts as solved, a number.
#'   `NULL`, the default, keeps the environment's own.
#' @return The id, invisibly.
#' @section Errors: `gym_error_argument` for an invalid argument, and from `gym_unregister()` for an
#'   id that is not registered.
#' @seealso [gym_env()]
#' @export
#' @examples
#' guess <- gym_env(
#'   reset = function(self) {
#'     self$secret <- sample(self$choices, 1) - 1
#'     0
#'   },
#'   step = function(self, action) {
#'     list(observation = 0, reward = as.numeric(action == self$secret), terminated = TRUE)
#'   },
#'   observation_space = space_discrete(1), action_space = space_discrete(4), choices = 4
#' )
#' gym_register("Guess-v0", guess)
#' rollout("Guess-v0", policy_random(), episodes = 100, seed = 1)
#' rollout("Guess-v0", policy_random(), episodes = 100, seed = 1, choices = 2)
#' gym_unregister("Guess-v0")
gym_register <- function(id, entry_point, ..., max_episode_steps = NULL, reward_threshold = NULL) {
  match_whole_names()
  if (!rlang::is_string(id) || !grepl("^[[:alnum:]_.:/-]+$", id)) {
    must <- "a string of letters, digits and `_.:/-`, such as \"Corridor-v0\""
    abort_argument(id, must, "id", rlang::current_env())
  }
  if (!inherits(entry_point, "gym_r_env") && !is.function(entry_point)) {
    must <- "an environment of `gym_env()`, or a function that returns an environment"
    abort_argument(entry_point, must, "entry_point", rlang::current_env())
  }
  arguments <- list(...)
  check_dots_named(arguments, "size = 5")
  check_not_shared(arguments)
  check_count(max_episode_steps, allow_null = TRUE)
  check_number(reward_threshold, allow_null = TRUE)
  if (inherits(entry_point, "gym_r_env")) {
    check_parameters(arguments, definition_of(entry_point), id)
  }
  changes <- list(
    id = id, max_episode_steps = if (!is.null(max_episode_steps)) as.integer(max_episode_steps),
    reward_threshold = reward_threshold
  )
  the_session$environments[[id]] <- list(
    entry_point = entry_point, arguments = arguments,
    changes = changes[!vapply(changes, is.null, NA)]
  )
  invisible(id)
}

#' @rdname gym_register
#' @export
gym_unregister <- function(id) {
  check_string(id)
  known <- names(the_session$environments)
  if (!id %in% known) {
    abort_wrong("id", id, rlang::current_env(),
                "No environment written in R is registered as \"{id}\".",
                i = did_you_mean(id, known, "\"%s\""))
  }
  the_session$environments[[id]] <- NULL
  invisible(id)
}

# Making a registered environment ------------------------------------------------------

#' Make a registered environment
#'
#' @param arguments The arguments of `entry_point`, and `max_episode_steps`, -1 for no limit.
#' @noRd
make_registered <- function(id, arguments = list(), call = rlang::caller_env()) {
  given <- given_id(id)
  registered <- the_session$environments[[given$id]]
  changes <- registered$changes
  if ("max_episode_steps" %in% names(arguments)) {
    limit <- arguments$max_episode_steps
    none <- identical(as.numeric(limit), -1)
    if (!none) check_count(limit, arg = "max_episode_steps", call = call)
    changes["max_episode_steps"] <- list(if (!none) as.integer(limit))
    arguments$max_episode_steps <- NULL
  }
  check_not_shared(arguments, call = call)
  own <- registered$arguments
  own[names(arguments)] <- arguments
  env <- registered$entry_point
  if (!inherits(env, "gym_r_env")) {
    known <- names(formals(args(env)))
    strange <- if (!"..." %in% known) setdiff(names(own), known)
    from <- "those of the `entry_point` that it was given"
    refuse_argument(strange, known, given$id, from, call)
    env <- with_generator(new_generator(0L), do.call(env, own))
    own <- list()
    if (!is_playable(env)) {
      abort_wrong("entry_point", env, call,
                  "The `entry_point` of {given$id} must return an environment, not
                   {describe_argument(env)}.",
                  i = "Make one by `gym_env()`.")
    }
  }
  if (inherits(env, "gym_r_env")) env <- change_r_env(env, changes, own, given$id, call)
  for (wrapper in given$wrappers) env <- wrap_r_env(env, wrapper[[1L]], wrapper[-1L], call)
  env
}

# Returns a new environment with the same functions and other values.
change_r_env <- function(env, changes, parameters, id, call) {
  definition <- definition_of(env)
  check_parameters(parameters, definition, id, call)
  definition$traits <- change_traits(definition$traits, changes)
  definition$parameters[names(parameters)] <- parameters
  r_env$new(definition)
}

# Refuses unknown values: the functions would ignore them.
check_parameters <- function(given, definition, id, call = rlang::caller_env()) {
  known <- c(names(definition$parameters), if (definition$vectorized) "num_envs")
  strange <- setdiff(names(given), known)
  from <- "the further values that `gym_env()` was given, such as `size = 5`"
  refuse_argument(strange, known, id, from, call)
}

refuse_argument <- function(strange, known, id, from, call) {
  if (length(strange)) {
    near <- did_you_mean(strange[[1L]], c(known, arguments_of(passed_on_by(strange[[1L]]))))
    abort_wrong(strange[[1L]], NULL, call, "{id} has no argument `{strange[[1L]]}`.",
                i = near %||% paste0("Its arguments are ", from, "."))
  }
}

# Makes an environment for gym_make(). `...` are the arguments that only a server's environment has.
make_registered_env <- function(id, arguments, seed, num_envs, wrappers, ..., call) {
  id <- with_wrappers(id, wrappers, call)
  check_for_r(id, list(...), call)
  check_seed(seed, min = 0, call = call)
  check_count(num_envs, allow_null = TRUE, call = call)
  env <- make_registered(id, arguments, call)
  id <- format(id)
  if (!is.null(num_envs)) {
    if (!isTRUE(definition_of(env)$vectorized)) {
      abort_wrong("num_envs", num_envs, call,
                  "`num_envs = {num_envs}` needs functions for all sub-environments at once, but
                   those of {id} are for one.",
                  i = "`rollout()` and searches play several copies of it, see their `num_envs`.")
    }
    env <- change_r_env(env, list(), list(num_envs = as.integer(num_envs)), id, call)
  }
  if (!is.null(seed) && inherits(env, "gym_r_env")) {
    sub_env <- sub_env_of(env)
    sub_env$generator <- new_generator(seed)
  }
  env
}

# Refuses arguments that only a server's environment has.
check_for_r <- function(id, servers, call = rlang::caller_env()) {
  given <- names(servers)[lengths(servers) > 0L]
  if (length(given)) {
    abort_wrong(given[[1L]], servers[[given[[1L]]]], call,
                "`{given[[1L]]}` is for an environment on a server, and {format(id)} is written in
                 R.",
                i = "Leave it out.")
  }
}

# In the registry ----------------------------------------------------------------------

#' Convert the environments written in R to rows of the server's registry
#' @param search A text to look for in their ids, `NULL` for all.
#' @noRd
registered_rows <- function(search = NULL) {
  ids <- as.character(names(the_session$environments))
  if (!is.null(search)) ids <- ids[grepl(tolower(search), tolower(ids), fixed = TRUE)]
  # The part of the spec that is known before the environment is made.
  specs <- lapply(the_session$environments[ids], function(registered) {
    made <- inherits(registered$entry_point, "gym_r_env")
    utils::modifyList(as.list(if (made) registered$entry_point$spec), registered$changes)
  })
  is_vectorized <- function(registered) isTRUE(definition_of(registered$entry_point)$vectorized)
  data.frame(
    id = ids,
    max_episode_steps = vapply(specs, function(spec) spec$max_episode_steps %||% NA_integer_, 0L),
    reward_threshold = vapply(specs, function(spec) as.numeric(spec$reward_threshold %||% NA), 0),
    vectorised = vapply(the_session$environments[ids], is_vectorized, NA),
    extra = rep(NA_character_, length(ids)), available = rep(TRUE, length(ids)),
    reason = rep(NA_character_, length(ids)), row.names = NULL
  )
}

# For calls that need a server's environment.
check_not_registered <- function(env_id, call = rlang::caller_env()) {
  given <- given_id(env_id)
  if (isTRUE(given$registered)) {
    abort_wrong("env_id", env_id, call,
                "{given$id} is an environment written in R, which a server cannot make.",
                i = "`gym_make(\"{given$id}\")` makes it here.")
  }
}

#' List the available environments
#'
#' List the environments that the server can make, those that require an extra (see
#' [gym_server_install()]), some that it cannot make at all, and the environments in R that this
#' session has registered (see [gym_register()]).
#'
#' @param client A client. The default is the session's client, [gym_client()].
#' @param search A text to look for in the ids, ignoring case. If there is no match, similar ids are
#'   listed. `NULL`, the default, lists all.
#' @return A data frame with one row for each environment: `id` (a string), `max_episode_steps`
#'   (integer, the step limit of an episode, `NA` for none), `reward_threshold` (double, the mean
#'   return from which the environment counts as solved, `NA` for none), `vectorised` (logical,
#'   whether it has its own vector implementation), `extra` (a string, the extra of the server that
#'   the environment requires, such as `"box2d"`, `NA` for none), `available` (logical, whether the
#'   server can make it) and `reason` (a string, why the server cannot make it, or `NA`; older
#'   servers give no reasons).
#' @section Errors: `gym_error_argument`, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' nrow(env_registry())
#' env_registry(search = "cartpole")
#' env_registry(search = "FrozenLaek")$id
env_registry <- function(client = gym_client(), search = NULL) {
  check_client(client)
  check_string(search, allow_null = TRUE)
  route <- paste0("/v1/registry/", query_text(list(search = search)[!is.null(search)]))
  environments <- get_answer(client, route)$environments
  column <- function(name, missing) listed_column(environments, name, missing)
  servers <- data.frame(
    id = column("id", ""), max_episode_steps = column("max_episode_steps", NA_integer_),
    reward_threshold = column("reward_threshold", NA_real_), vectorised = column("vectorised", NA),
    extra = column("extra", NA_character_), available = column("available", NA),
    reason = column("reason", NA_character_)
  )
  own <- registered_rows(search)
  rbind(servers[!servers$id %in% own$id, ], own, make.row.names = FALSE)
}

# The instances on a server ---------------------------------------------------------------

#' List the environments on a server
#'
#' For a server that several sessions share: list its environments with their names, age and last
#' use. [env_list_all()] returns only their ids.
#'
#' @inheritParams env_registry
#' @return A data frame with one row for each environment of all clients, the oldest first:
#'   `instance_id` (a string, for [env_close()] and the other classic calls), `name` (a string,
#'   given by its owner in [gym_make()] or [env_create()], or `NA`), `env_id` (a string), `num_envs`
#'   (integer, the number of sub-environments, `NA` for a single environment), `age` (double, the
#'   seconds since it was made), `idle` (double, the seconds since its last reset or step), `steps`
#'   (double, the number of steps, in all sub-environments together) and `watched` (logical, whether
#'   somebody watches it).
#' @section Errors: `gym_error_argument`, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", name = "first try")
#' env_list()
#' env$close()
env_list <- function(client = gym_client()) {
  check_client(client)
  close_queued(client)
  instances <- get_answer(client, "/v1/instances/")$instances
  column <- function(name, missing) listed_column(instances, name, missing)
  data.frame(
    instance_id = column("instance_id", ""), name = column("name", NA_character_),
    env_id = column("env_id", ""), num_envs = column("num_envs", NA_integer_),
    age = column("age_seconds", NA_real_), idle = column("idle_seconds", NA_real_),
    steps = column("steps", NA_real_), watched = column("watched", NA)
  )
}
