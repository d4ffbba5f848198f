# What the parts of an observation are called, from the tables "Observation
# Space" in Gymnasium's documentation of each environment
# (https://gymnasium.farama.org/environments/classic_control/, toy_text/ and
# box2d/).

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
  LunarLander = c(
    "x", "y", "x_velocity", "y_velocity", "angle", "angular_velocity",
    "left_leg_contact", "right_leg_contact"
  ),
  MountainCar = c("position", "velocity"),
  MountainCarContinuous = c("position", "velocity"),
  Pendulum = c("cos_theta", "sin_theta", "angular_velocity"),
  Taxi = "state"
)
observation_parts$LunarLanderContinuous <- observation_parts$LunarLander

# Wrappers after which a number is no longer what the documentation calls by its name.
changing_wrappers <- c("DiscretizeObservation", "NormalizeObservation", "RescaleObservation")

#' Name the numbers or parts of what is observed
#' @param space The observation space of one sub-environment.
#' @param wrappers The names of the wrappers around the environment.
#' @return Strings, `NULL` where they are unknown, or a wrapper has changed what is observed.
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
