# Steps and resets of a sub-environment written in R, which definition_sub_env() makes, and its
# traits: the part that never changes.

#' Start an episode
#'
#' @param seed The seed of the sub-environment's generator. `NULL` continues the generator, or, if
#'   there is none yet, draws a seed from the session's generator.
#' @return The first observation, checked; for a vectorised environment, a batch of them.
#' @noRd
reset_sub_env <- function(sub_env, seed = NULL, options = NULL, sub_env_number = NULL,
                          call = rlang::caller_env()) {
  if (!is.null(options) && !sub_env$takes_options) {
    abort_wrong("options", options, call,
                "`reset()` of {sub_env$traits$spec$id} does not accept options.",
                i = "Give it an argument `options` to accept them.")
  }
  if (!is.null(seed) || is.null(sub_env$generator)) {
    sub_env$generator <- new_generator(seed %||% draw_seed())
  }
  sub_env$taken <- NA_integer_
  observation <- withCallingHandlers(
    with_generator(sub_env$generator, sub_env$reset(seed, options)),
    error = function(cnd) abort_raised(cnd, sub_env, sub_env_number, call)
  )
  where <- paste0("`reset()` of ", sub_env$traits$spec$id)
  observation <- checked_observation(sub_env$traits, observation, sub_env$num_envs, where, call)
  sub_env$taken <- 0L
  sub_env$ended <- logical(sub_env$num_envs %||% 1L)
  observation
}

#' Take a step
#'
#' @param action One checked action, or a batch of them for a vectorised environment.
#' @return The result of the user's `step()`, unchecked.
#' @noRd
raw_step <- function(sub_env, action, call) {
  out <- withCallingHandlers(
    with_generator(sub_env$generator, sub_env$step(action)),
    error = function(cnd) abort_raised(cnd, sub_env, NULL, call)
  )
  sub_env$taken <- sub_env$taken + 1L
  out
}

check_was_reset <- function(sub_env, call) {
  if (is.na(sub_env$taken)) {
    abort_wrong("env", NULL, call, "{sub_env$traits$spec$id} has not been reset.",
                i = "`env$reset()` starts an episode.")
  }
}

#' Report an error in the user's function, and say where it occurred
#'
#' @param method Which of the user's functions raised it.
#' @noRd
abort_raised <- function(cnd, sub_env, sub_env_number, call,
                         method = if (is.na(sub_env$taken)) "reset" else "step") {
  # A wrapper's error already says what went wrong.
  if (inherits(cnd, "gym_error_wrapper")) return(invisible())
  id <- sub_env$traits$spec$id
  step <- if (method == "step") sub_env$taken + 1L
  at <- if (!is.null(step)) paste0(" in step ", step, " of the episode")
  in_sub_env <- if (!is.null(sub_env_number)) paste0(" (sub-environment ", sub_env_number, ")")
  gym_abort(
    paste0("`", method, "()` of ", id, " raised an error", at, in_sub_env, "."),
    class = c(own_classes(cnd), "gym_error_environment"),
    env_id = id, step = step, sub_env = sub_env_number, call = call, parent = cnd
  )
}

# Traits ---------------------------------------------------------------------------------

# The traits of an environment written in R never change: its spaces, its spec, and the checks of
# every step, which are prepared once.

#' Describe an environment written in R
#'
#' @return A list: `observation_space`, `action_space`, `spec`; `limit`, the number of steps after
#'   which an episode is cut off, `Inf` for never; `observation_rules`, the observation space with
#'   slightly wider bounds, which allow rounding errors; `action_rules`, the action space without
#'   the bounds of its Boxes, because `step()` also gets a Box action outside its bounds, as in
#'   Gymnasium; `fits_observations` and `fits_actions`, fast checks of batches.
#' @noRd
new_traits <- function(observation_space, action_space, id, max_episode_steps = NULL,
                       reward_threshold = NULL, render_fps = NULL, call = rlang::caller_env()) {
  check_space(observation_space, call = call)
  check_space(action_space, call = call)
  check_string(id, call = call)
  check_count(max_episode_steps, allow_null = TRUE, call = call)
  check_number(reward_threshold, allow_null = TRUE, call = call)
  check_number(render_fps, min = 0.1, allow_null = TRUE, call = call)
  observation_rules <- allow_rounding(observation_space)
  action_rules <- loosen_boxes(action_space)
  list(
    observation_space = observation_space, action_space = action_space,
    spec = list(
      id = id, reward_threshold = reward_threshold,
      max_episode_steps = if (!is.null(max_episode_steps)) as.integer(max_episode_steps),
      render_fps = render_fps
    ),
    limit = max_episode_steps %||% Inf, observation_rules = observation_rules,
    action_rules = action_rules, fits_observations = quick_check(observation_rules),
    fits_actions = quick_check(action_rules)
  )
}

# The traits with another id or limit: `changes` are elements of the spec.
change_traits <- function(traits, changes) {
  traits$spec[names(changes)] <- changes
  traits$limit <- traits$spec$max_episode_steps %||% Inf
  traits
}

change_spaces <- function(traits, observation_space = traits$observation_space,
                          action_space = traits$action_space, call = NULL) {
  changed <- new_traits(observation_space, action_space, traits$spec$id, call = call)
  parts <- c("observation_space", "action_space", "observation_rules", "action_rules",
             "fits_observations", "fits_actions")
  traits[parts] <- changed[parts]
  traits
}

loosen_boxes <- function(space) {
  if (inherits(space, "gym_space_box")) {
    space$low <- ifelse(is.finite(space$low), -.Machine$double.xmax, space$low)
    space$high <- ifelse(is.finite(space$high), .Machine$double.xmax, space$high)
  } else if (has_parts(space)) {
    space$spaces <- lapply(space$spaces, loosen_boxes)
  }
  space
}

# Actions and observations ------------------------------------------------------------

#' Check actions and convert them to the form that the user's functions expect
#' @param which The numbers of the sub-environments that take the actions, `NULL` for a single
#'   action.
#' @noRd
checked_action <- function(traits, action, which, call) {
  rules <- traits$action_rules
  if (!is.null(attributes(action)) || is.list(action)) {
    action <- action_by_name(traits$action_space, action, traits$spec$id, call)
  }
  n <- if (!is.null(which)) length(which)
  if (!fits_quickly(rules, action, n, traits$fits_actions)) {
    check_one_or_batch(rules, action, n, call, which)
  }
  space <- traits$action_space
  if (is.null(n)) tidy_value(space, action, NULL) else tidy_actions(space, action)
}

#' Convert a value to the form that values from a server have
#'
#' Whole numbers become integers, the parts of a Dict get the order of the space, and numbers get
#' the names of the space, if it has any.
#' @param n The number of values in a batch; `NULL` for a single value.
#' @noRd
tidy_value <- function(space, value, n) {
  if (inherits(space, "gym_space_discrete")) {
    return(narrow_whole(value))
  }
  if (inherits(space, "gym_space_array") && length(space$shape) == 1L) {
    if (is.null(n)) {
      dim(value) <- NULL
      names(value) <- space$names
    } else {
      if (is.null(dim(value))) dim(value) <- c(length(value), 1L)
      columns <- if (!is.null(space$names)) list(NULL, space$names)
      if (!identical(dimnames(value), columns)) dimnames(value) <- columns
    }
  } else if (has_parts(space)) {
    value <- map_parts(space, tidy_value, in_order(space, value), list(n))
    if (!is.null(space$names)) names(value) <- space$names
  }
  value
}

#' Make a function that takes one action from a checked batch
#' @noRd
action_picker <- function(space) {
  if (inherits(space, "gym_space_discrete")) {
    function(batch, i) batch[[i]]
  } else if (inherits(space, "gym_space_array") && length(space$shape) == 1L) {
    function(batch, i) if (is.null(dim(batch))) batch[[i]] else batch[i, ]
  } else {
    function(batch, i) batch_value(space, batch, i)
  }
}

# TRUE counts as 1 for Discrete actions.
tidy_actions <- function(space, action) {
  if (inherits(space, "gym_space_discrete")) {
    return(narrow_whole(action))
  }
  if (is.array(action) && !is.null(dimnames(action))) dimnames(action) <- NULL
  action
}
