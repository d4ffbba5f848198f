#' Register an environment written in R
#'
#' Register an environment written in R under an id, which [gym_make()], [rollout()], every search
#' and [env_registry()] then accept. It is registered until the end of the session. Registering an
#' id again replaces the environment, even one of Gymnasium.
#'
#' If several sub-environments are played together, the environment of [gym_env()] is copied. Random
#' numbers in `entry_point` use the same seed every time, so that it always makes the same
#' environment. Draw values that should differ between episodes in `reset`.
#'
#' @param id The id, a string of letters, digits and `_.:/-`, such as `"Corridor-v0"`.
#' @param entry_point The environment's maker: an environment of [gym_env()], or a function that
#'   returns an environment.
#' @param ... Arguments for `entry_point`, by name, which [gym_make()] and [rollout()] can override.
#'   For an environment of [gym_env()] they are values with which each `self` starts.
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
  check_entry_point(entry_point)
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
    gym_abort(
      c(paste0("No environment written in R is registered as \"", id, "\"."),
        i = did_you_mean(id, known, "\"%s\"")),
      class = "gym_error_argument", argument = "id", value = id
    )
  }
  the_session$environments[[id]] <- NULL
  invisible(id)
}

check_entry_point <- function(entry_point, call = rlang::caller_env()) {
  if (!inherits(entry_point, "gym_r_env") && !is.function(entry_point)) {
    must <- "an environment of `gym_env()`, or a function that returns an environment"
    abort_argument(entry_point, must, "entry_point", call)
  }
}

# Whether the id is registered in this session, which a server cannot know.
is_registered <- function(x) {
  id <- bare_id(x)
  rlang::is_string(id) && id %in% names(the_session$environments)
}

# Making one ---------------------------------------------------------------------------

#' Make a registered environment
#'
#' @param arguments The arguments of `entry_point`, and `max_episode_steps`, -1 for no limit.
#' @noRd
make_registered <- function(id, arguments = list(), call = rlang::caller_env()) {
  env <- make_entry(bare_id(id), arguments, call)
  for (wrapper in noted_wrappers(id)) {
    env <- wrap_r_env(env, wrapper[[1L]], wrapper[-1L], call)
  }
  env
}

make_entry <- function(id, arguments, call) {
  registered <- the_session$environments[[id]]
  changes <- registered$changes
  if ("max_episode_steps" %in% names(arguments)) {
    changes["max_episode_steps"] <- list(own_limit(arguments$max_episode_steps, call))
    arguments$max_episode_steps <- NULL
  }
  check_not_shared(arguments, call = call)
  given <- registered$arguments
  given[names(arguments)] <- arguments
  entry_point <- registered$entry_point
  if (inherits(entry_point, "gym_r_env")) {
    return(change_r_env(entry_point, changes, given, id, call))
  }
  known <- names(formals(args(entry_point)))
  strange <- if (!"..." %in% known) setdiff(names(given), known)
  refuse_argument(strange, known, id, "those of the `entry_point` that it was given", call)
  env <- with_generator(new_generator(0L), do.call(entry_point, given))
  if (!is_playable(env)) {
    gym_abort(
      c(paste0("The `entry_point` of ", id, " must return an environment, not ",
               describe_argument(env), "."),
        i = "Make one by `gym_env()`."),
      class = "gym_error_argument", argument = "entry_point", value = env, call = call
    )
  }
  if (inherits(env, "gym_r_env")) change_r_env(env, changes, list(), id, call) else env
}

own_limit <- function(max_episode_steps, call) {
  if (identical(as.numeric(max_episode_steps), -1)) {
    return(NULL)
  }
  as.integer(check_count(max_episode_steps, call = call))
}

# Another environment with the same functions and other values.
change_r_env <- function(env, changes, parameters, id, call) {
  definition <- definition_of(env)
  check_parameters(parameters, definition, id, call)
  definition$traits <- change_traits(definition$traits, changes)
  definition$parameters[names(parameters)] <- parameters
  r_env$new(definition)
}

# A value that the functions do not use would change nothing.
check_parameters <- function(given, definition, id, call = rlang::caller_env()) {
  known <- c(names(definition$parameters), if (definition$vectorized) "num_envs")
  strange <- setdiff(names(given), known)
  from <- "the further values that `gym_env()` was given, such as `size = 5`"
  refuse_argument(strange, known, id, from, call)
}

refuse_argument <- function(strange, known, id, from, call) {
  if (length(strange)) {
    gym_abort(
      c(paste0(id, " has no argument `", strange[[1L]], "`."),
        i = did_you_mean(strange[[1L]], c(known, arguments_of(passed_on_by(strange[[1L]])))) %||%
          paste0("Its arguments are ", from, ".")),
      class = "gym_error_argument", argument = strange[[1L]], call = call
    )
  }
}

# For gym_make(). `...` are the arguments that only a server's environment has.
make_registered_env <- function(id, arguments, seed, num_envs, wrappers, ..., call) {
  id <- with_wrappers(id, wrappers, call)
  check_for_r(id, list(...), call)
  check_seed(seed, min = 0, call = call)
  check_count(num_envs, allow_null = TRUE, call = call)
  env <- make_registered(id, arguments, call)
  id <- format(id)
  if (!is.null(num_envs)) {
    env <- with_num_envs(env, num_envs, id, call)
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
    gym_abort(
      c(paste0("`", given[[1L]], "` is for an environment on a server, and ", format(id),
               " is written in R."),
        i = "Leave it out."),
      class = "gym_error_argument", argument = given[[1L]], value = servers[[given[[1L]]]],
      call = call
    )
  }
}

with_num_envs <- function(env, num_envs, id, call) {
  if (!isTRUE(definition_of(env)$vectorized)) {
    gym_abort(
      c(paste0("`num_envs = ", num_envs, "` needs functions for all sub-environments at once, but ",
               "those of ", id, " are for one."),
        i = "`rollout()` and searches play several copies of it, see their `num_envs`."),
      class = "gym_error_argument", argument = "num_envs", value = num_envs, call = call
    )
  }
  change_r_env(env, list(), list(num_envs = as.integer(num_envs)), id, call)
}

#' Convert a registered environment to a vector environment
#' @noRd
registered_vector_env <- function(id, num_envs, arguments, max_envs, frames,
                                  call = rlang::caller_env()) {
  env <- make_registered(id, arguments, call)
  as_vector_env(env, num_envs, max_envs = max_envs, frames = frames)
}

# In the registry ----------------------------------------------------------------------

#' Convert the environments written in R to rows of the server's registry
#' @param search A text to look for in their ids, `NULL` for all.
#' @noRd
registered_rows <- function(search = NULL) {
  ids <- as.character(names(the_session$environments))
  if (!is.null(search)) {
    ids <- ids[grepl(tolower(search), tolower(ids), fixed = TRUE)]
  }
  specs <- lapply(ids, registered_spec)
  is_vectorized <- function(registered) isTRUE(definition_of(registered$entry_point)$vectorized)
  data.frame(
    id = ids,
    max_episode_steps = vapply(specs, function(spec) spec$max_episode_steps %||% NA_integer_, 0L),
    reward_threshold = vapply(specs, function(spec) as.numeric(spec$reward_threshold %||% NA), 0),
    vectorised = vapply(the_session$environments[ids], is_vectorized, NA, USE.NAMES = FALSE),
    extra = rep(NA_character_, length(ids)),
    available = rep(TRUE, length(ids)),
    reason = rep(NA_character_, length(ids))
  )
}

# The part of the spec that is known without making the environment.
registered_spec <- function(id) {
  registered <- the_session$environments[[id]]
  spec <- if (inherits(registered$entry_point, "gym_r_env")) registered$entry_point$spec
  spec <- as.list(spec)
  spec[names(registered$changes)] <- registered$changes
  spec
}

# A server has no access to an environment written in R.
check_not_registered <- function(env_id, call = rlang::caller_env()) {
  if (is_registered(env_id)) {
    id <- bare_id(env_id)
    gym_abort(
      c(paste0(id, " is an environment written in R, which a server cannot make."),
        i = paste0("`gym_make(\"", id, "\")` makes it here.")),
      class = "gym_error_argument", argument = "env_id", value = env_id, call = call
    )
  }
}
