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

# After these wrappers a number no longer matches its name in the documentation.
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

# The units of the parts of observations, and the values between which an episode goes on: from the
# sections "Observation Space" and "Episode End" in Gymnasium's documentation of each environment
# (https://gymnasium.farama.org/environments/). If these say nothing, they come from the documented
# code: CartPole computes in metres, kilograms and seconds (gravity 9.8), and Pendulum's
# documentation defines theta in radians. Parts without a unit in either, such as LunarLander's
# coordinates, have none.

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
#' @return A string; `NULL` if a wrapper changes the values, which then have other units and none
#'   of the documented limits.
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

# The units of actions that are one number. Pendulum's documentation has "torque in N m".
action_units <- list(Pendulum = "N m")
