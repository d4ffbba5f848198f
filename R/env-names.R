# The meanings of actions, from the sections "Action Space" in Gymnasium's documentation of each
# environment (https://gymnasium.farama.org/environments/).

action_meanings <- list(
  Acrobot = c("torque -1", "no torque", "torque +1"), Blackjack = c("stick", "hit"),
  CartPole = c("push left", "push right"), CliffWalking = c("up", "right", "down", "left"),
  CliffWalkingSlippery = c("up", "right", "down", "left"),
  FrozenLake = c("left", "down", "right", "up"), FrozenLake8x8 = c("left", "down", "right", "up"),
  LunarLander = c("no engine", "left engine", "main engine", "right engine"),
  LunarLanderContinuous = c("main engine", "side engines"),
  MountainCar = c("push left", "no push", "push right"), MountainCarContinuous = "force",
  Pendulum = "torque", Taxi = c("south", "north", "east", "west", "pick up", "drop off")
)

#' Find the meanings of an environment's actions
#' @param n The number of actions; for a Box, the count of numbers in an action; `NULL` if
#'   unknown.
#' @return Strings; `NULL` if the environment is unknown or a wrapper has changed the actions.
#' @noRd
action_meaning <- function(env_id, n = NULL) {
  meaning <- action_meanings[[environment_family(env_id), exact = TRUE]]
  if (is.null(n) || length(meaning) == n) meaning
}

# "CartPole" for "CartPole-v1".
environment_family <- function(env_id) sub("-v[0-9]+$", "", env_id %||% "")

#' Name the actions of an environment
#' @param n The number of actions; for a Box, the count of numbers in an action.
#' @param start The first action.
#' @return Strings such as `"0: push left"`, or only the numbers if the meanings are unknown.
#' @noRd
action_names <- function(env_id, n, start = 0L) {
  number <- as.character(start + seq_len(n) - 1L)
  meaning <- action_meaning(env_id, n)
  if (is.null(meaning)) number else paste0(number, ": ", meaning)
}

#' Name the numbers of a Box action
#' @noRd
action_parts <- function(env_id, n) {
  action_meaning(env_id, n) %||% if (n == 1L) "action" else paste0("action_", seq_len(n))
}

#' Convert actions given by their meanings to numbers
#' @return The actions; values other than text are unchanged.
#' @noRd
numbered_actions <- function(instance, action, call) {
  space <- instance$single_action_space
  named <- is.character(action) && inherits(space, "gym_space_discrete")
  meaning <- if (named) action_meaning(instance$spec$id, space$n)
  if (is.null(meaning)) {
    return(action)
  }
  number <- match(sub("^[0-9]+: ", "", action), meaning)
  if (anyNA(number)) {
    unknown <- describe_value(action[is.na(number)][[1L]])
    names <- action_names(instance$spec$id, space$n, space$start)
    gym_abort(
      c(paste0("There is no action ", unknown, " in ", instance$spec$id, "."),
        i = paste0("Its actions: ", toString(names), ".")),
      class = "gym_error_space", space = space, value = action, path = "", call = call
    )
  }
  as.integer(space$start) + number - 1L
}

# Actions with names -----------------------------------------------------------------------

#' Sort the numbers or parts of an action by their names, in the order of the space
#'
#' The names may be those of the space, of the documentation, or of the columns of a table of steps.
#' @param space The action space.
#' @param action One action, or a batch of them.
#' @return The action without names. Unknown names are an error.
#' @noRd
action_by_name <- function(space, action, env_id, call) {
  if (is.list(action)) {
    n <- length(space$spaces)
    given <- names(action)
    # check_value() refuses other keys.
    if (!has_parts(space) || length(action) != n || !all(names(space$spaces) %in% given)) {
      return(action)
    }
    if (is.null(names(space$spaces)) && !is.null(given)) {
      forms <- list(space$names, part_columns("action", space$names %||% seq_len(n)))
      at <- places_of_names(given, forms)
      if (is.null(at)) abort_action_names(space, action, given, forms, call)
      action <- unname(action[at])
    }
    return(map_parts(space, action_by_name, in_order(space, action), list(NULL), list(call)))
  }
  rows <- length(dim(action)) == 2L
  given <- if (rows) colnames(action) else names(action)
  n <- prod(space$shape)
  if (is.null(given) || length(space$shape) != 1L || n < 2) {
    # Names of single numbers are only labels, such as those that predict() adds.
    return(action)
  }
  own <- space$names %||% action_meaning(env_id, n)
  forms <- list(own, part_columns("action", space$names %||% seq_len(n)))
  at <- places_of_names(given, forms, labels = rows && is.null(own))
  if (is.null(at)) abort_action_names(space, action, given, forms, call)
  unname(if (rows) action[, at, drop = FALSE] else action[at])
}

#' Find the places of known names among given ones
#'
#' @param forms A list of character vectors. The given names must be those of one vector.
#' @param labels Whether to ignore the names if none of them is known. cbind(), for example, makes
#'   column names of the names of variables.
#' @return An index that puts values in the order of the known names: integers, or `TRUE` to keep
#'   the order as it is. `NULL` for names that must be refused.
#' @noRd
places_of_names <- function(given, forms, labels = FALSE) {
  if (is.null(given) || labels && !any(given %in% unlist(forms))) {
    return(TRUE)
  }
  for (known in forms) {
    if (length(given) == length(known) && setequal(given, known)) {
      return(match(known, given))
    }
  }
}

abort_action_names <- function(space, action, given, forms, call) {
  known <- vapply(Filter(length, forms), few_names, "")
  gym_abort(
    c(paste0("The names of an action of ", format(space), " are ", paste(known, collapse = ", or "),
             ", not ", few_names(given), "."),
      i = "Without names it is taken by position: `unname()` removes them."),
    class = "gym_error_space", space = space, value = action, path = "", call = call
  )
}

# Observations -----------------------------------------------------------------------------------

# The names of the parts of observations, from the tables "Observation Space" in Gymnasium's
# documentation of each environment (https://gymnasium.farama.org/environments/classic_control/,
# toy_text/, box2d/ and mujoco/). Other environments, and those with another number of parts, have
# no names.
observation_parts <- list(
  Acrobot = c(
    "cos_theta1", "sin_theta1", "cos_theta2", "sin_theta2",
    "angular_velocity_theta1", "angular_velocity_theta2"
  ),
  Blackjack = c("player_sum", "dealer_card", "usable_ace"),
  CartPole = c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity"),
  CliffWalking = "position", CliffWalkingSlippery = "position", FrozenLake = "position",
  FrozenLake8x8 = "position",
  HalfCheetah = c(
    "tip_z", "tip_angle", "back_thigh_angle", "back_shin_angle", "back_foot_angle",
    "front_thigh_angle", "front_shin_angle", "front_foot_angle", "tip_x_velocity",
    "tip_z_velocity", "tip_angular_velocity", "back_thigh_angular_velocity",
    "back_shin_angular_velocity", "back_foot_angular_velocity", "front_thigh_angular_velocity",
    "front_shin_angular_velocity", "front_foot_angular_velocity"
  ),
  Hopper = c(
    "torso_z", "torso_angle", "thigh_angle", "leg_angle", "foot_angle", "torso_x_velocity",
    "torso_z_velocity", "torso_angular_velocity", "thigh_angular_velocity",
    "leg_angular_velocity", "foot_angular_velocity"
  ),
  InvertedDoublePendulum = c(
    "cart_position", "sin_theta1", "sin_theta2", "cos_theta1", "cos_theta2", "cart_velocity",
    "angular_velocity_theta1", "angular_velocity_theta2", "constraint_force"
  ),
  InvertedPendulum = c("cart_position", "pole_angle", "cart_velocity", "pole_angular_velocity"),
  LunarLander = c(
    "x", "y", "x_velocity", "y_velocity", "angle", "angular_velocity",
    "left_leg_contact", "right_leg_contact"
  ),
  MountainCar = c("position", "velocity"), MountainCarContinuous = c("position", "velocity"),
  Pendulum = c("cos_theta", "sin_theta", "angular_velocity"),
  Reacher = c(
    "cos_theta1", "cos_theta2", "sin_theta1", "sin_theta2", "target_x", "target_y",
    "angular_velocity_theta1", "angular_velocity_theta2", "fingertip_minus_target_x",
    "fingertip_minus_target_y"
  ),
  Swimmer = c(
    "tip_angle", "first_rotor_angle", "second_rotor_angle", "tip_x_velocity", "tip_y_velocity",
    "tip_angular_velocity", "first_rotor_angular_velocity", "second_rotor_angular_velocity"
  ),
  Taxi = "state",
  Walker2d = c(
    "torso_z", "torso_angle", "thigh_angle", "leg_angle", "foot_angle", "left_thigh_angle",
    "left_leg_angle", "left_foot_angle", "torso_x_velocity", "torso_z_velocity",
    "torso_angular_velocity", "thigh_angular_velocity", "leg_angular_velocity",
    "foot_angular_velocity", "left_thigh_angular_velocity", "left_leg_angular_velocity",
    "left_foot_angular_velocity"
  )
)
observation_parts$LunarLanderContinuous <- observation_parts$LunarLander

# These wrappers change the observations, so the names of the documentation no longer match.
changing_wrappers <- c("DiscretizeObservation", "NormalizeObservation", "RescaleObservation")

#' Name the numbers or parts of observations
#' @param space The observation space of one sub-environment.
#' @param wrappers The names of the wrappers around the environment.
#' @return Strings; `NULL` if they are unknown, or a wrapper has changed the observations.
#' @noRd
observation_names <- function(env_id, space, wrappers = character()) {
  parts <- observation_parts[[environment_family(env_id), exact = TRUE]]
  if (is.null(parts) || any(wrappers %in% changing_wrappers)) {
    return(NULL)
  }
  n <- if (inherits(space, "gym_space_discrete")) {
    1L
  } else if (inherits(space, "gym_space_tuple")) {
    length(space$spaces)
  } else if (inherits(space, "gym_space_box") && length(space$shape) == 1L) {
    space$shape
  }
  if (identical(n, length(parts))) parts
}

# Units and limits ------------------------------------------------------------------------

# The units of the parts of observations, and the limits at which an episode ends. Both come from
# the sections "Observation Space" and "Episode End" in Gymnasium's documentation of each
# environment (https://gymnasium.farama.org/environments/). If the documentation says nothing, they
# come from the code: CartPole computes in metres, kilograms and seconds (gravity 9.8), and
# Pendulum's documentation defines theta in radians. Parts without a unit in either, such as
# LunarLander's coordinates, have none.

observation_units <- list(
  Acrobot = c(angular_velocity_theta1 = "rad/s", angular_velocity_theta2 = "rad/s"),
  CartPole = c(
    cart_position = "m", cart_velocity = "m/s", pole_angle = "rad", pole_angular_velocity = "rad/s"
  ),
  LunarLander = c(angle = "rad"), MountainCar = c(position = "m"),
  MountainCarContinuous = c(position = "m"), Pendulum = c(angular_velocity = "rad/s")
)
observation_units$LunarLanderContinuous <- observation_units$LunarLander

# Values at which an episode ends: by failure, or at the goal.
episode_limits <- list(
  CartPole = list(
    cart_position = list(at = c(-2.4, 2.4), kind = "failure", text = "fails at \u00b12.4"),
    # 0.2094 rad, which the documentation rounds to 0.2095.
    pole_angle = list(
      at = c(-1, 1) * 12 * pi / 180, kind = "failure", text = "fails at \u00b112\u00b0"
    )
  ),
  LunarLander = list(x = list(at = c(-1, 1), kind = "failure", text = "fails at \u00b11")),
  MountainCar = list(position = list(at = 0.5, kind = "goal", text = "goal: 0.5")),
  MountainCarContinuous = list(position = list(at = 0.45, kind = "goal", text = "goal: 0.45"))
)
episode_limits$LunarLanderContinuous <- episode_limits$LunarLander

#' Find the id whose documentation describes the values in a result
#' @param what "Observation" or "Action".
#' @return A string; `NULL` if a wrapper changes the values, because the documented units and
#'   limits no longer apply.
#' @noRd
described_id <- function(x, what = "Observation") {
  changing <- paste0(c("Discretize", "Normalize", "Rescale", "Transform"), what)
  if (!any(changing %in% wrappers_around(x))) x$env_id
}

#' Write the name of a part of an observation with its unit
#' @param names Names of columns of a table of steps.
#' @return Strings such as `"pole angle (rad)"`; unknown names are unchanged.
#' @noRd
observation_labels <- function(env_id, names) {
  family <- environment_family(env_id)
  known <- names %in% observation_parts[[family, exact = TRUE]]
  words <- ifelse(known, gsub("_", " ", names, fixed = TRUE), names)
  units <- observation_units[[family, exact = TRUE]]
  measured <- known & names %in% names(units)
  words[measured] <- paste0(words[measured], " (", units[names[measured]], ")")
  words
}

# The units of actions that are one number. Pendulum's documentation says "torque in N m".
action_units <- list(Pendulum = "N m")
