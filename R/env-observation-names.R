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

# The names of the columns where the environment is unknown or a wrapper has changed what it shows.
observation_names <- function(env_id, columns) {
  parts <- observation_parts[[environment_family(env_id), exact = TRUE]]
  if (length(parts) == length(columns)) parts else columns
}

#' Put a batch of observations into the columns of a table
#' @return A named list of columns.
#' @noRd
observation_columns <- function(space, observations, env_id) {
  columns <- value_columns(space, observations, "obs")
  if (is_stackable(space)) {
    names(columns) <- paste0("obs_", seq_along(columns), recycle0 = TRUE)
  }
  names(columns) <- observation_names(env_id, names(columns))
  columns
}
