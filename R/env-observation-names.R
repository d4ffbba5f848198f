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
  CliffWalking = "position",
  CliffWalkingSlippery = "position",
  FrozenLake = "position",
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
  MountainCar = c("position", "velocity"),
  MountainCarContinuous = c("position", "velocity"),
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
