# The constant part of an environment written in R: its spaces and its spec, and the checks of every
# step, which are prepared once.

#' Describe an environment written in R
#'
#' @return A list: `observation_space`, `action_space`, `spec`; `limit`, the number of steps after
#'   which an episode is cut off, `Inf` for never; `action_rules`, the action space without the
#'   bounds of its Boxes, because a Box action outside its bounds is passed to the environment as in
#'   Gymnasium; `fits_observations` and `fits_actions`, fast checks of batches.
#' @noRd
new_traits <- function(observation_space, action_space, id, max_episode_steps = NULL,
                       reward_threshold = NULL, render_fps = NULL, call = rlang::caller_env()) {
  check_is_space(observation_space, call = call)
  check_is_space(action_space, call = call)
  check_string(id, call = call)
  check_count(max_episode_steps, allow_null = TRUE, call = call)
  check_number(reward_threshold, allow_null = TRUE, call = call)
  check_number(render_fps, min = 0.1, allow_null = TRUE, call = call)
  rules <- loosen_boxes(action_space)
  list(
    observation_space = observation_space,
    action_space = action_space,
    spec = list(
      id = id, reward_threshold = reward_threshold,
      max_episode_steps = if (!is.null(max_episode_steps)) as.integer(max_episode_steps),
      render_fps = render_fps
    ),
    limit = max_episode_steps %||% Inf,
    action_rules = rules,
    fits_observations = quick_check(observation_space),
    fits_actions = quick_check(rules)
  )
}

# The same environment with another id or limit: `changes` are elements of its spec.
change_traits <- function(traits, changes) {
  traits$spec[names(changes)] <- changes
  traits$limit <- traits$spec$max_episode_steps %||% Inf
  traits
}

check_is_space <- function(x, arg = rlang::caller_arg(x), call) {
  if (!inherits(x, "gym_space")) {
    gym_abort(
      c(paste0("`", arg, "` must be a space, not ", describe_argument(x), "."),
        i = "`space_box()`, `space_discrete()` and others make one."),
      class = "gym_error_argument", argument = arg, value = x, call = call
    )
  }
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

#' Check the actions of several sub-environments
#' @param which The numbers of these sub-environments.
#' @noRd
check_actions <- function(traits, action, which, call) {
  n <- length(which)
  if (!traits$fits_actions(action, n)) {
    rules <- traits$action_rules
    check_batch(rules, batch_space(rules, n), action, n, call, which, bounds = TRUE)
  }
}

#' Convert a value to the form of a server's values
#'
#' Whole numbers become integers, the parts of a Dict get the order of the space, and numbers get
#' the names of the space, if it has any.
#' @param n The number of values in a batch; `NULL` for a single value.
#' @noRd
tidy_value <- function(space, value, n) {
  if (inherits(space, "gym_space_discrete")) {
    return(narrow_if_double(value))
  }
  if (has_parts(space)) {
    return(name_parts(space, map_parts(space, tidy_value, in_order(space, value), list(n))))
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
  }
  value
}

name_parts <- function(space, parts) {
  if (!is.null(space$names)) {
    names(parts) <- space$names
  }
  parts
}

narrow_if_double <- function(x) {
  if (is.object(x) || is.integer(x)) unname(x) else as_integer_if_small(x)
}

as_integer_if_small <- function(x) if (within_integer(x)) as.integer(x) else as.numeric(x)

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
    narrow_if_double(action)
  } else {
    if (is.array(action) && !is.null(dimnames(action))) {
      dimnames(action) <- NULL
    }
    action
  }
}
