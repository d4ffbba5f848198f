# What the parts of an observation are called, from the tables "Observation
# Space" in Gymnasium's documentation of each environment
# (https://gymnasium.farama.org/environments/classic_control/ and toy_text/).

observation_parts <- list(
  Acrobot = c(
    "cos_theta1", "sin_theta1", "cos_theta2", "sin_theta2",
    "angular_velocity_theta1", "angular_velocity_theta2"
  ),
  CartPole = c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity"),
  CliffWalking = "position",
  FrozenLake = "position",
  FrozenLake8x8 = "position",
  MountainCar = c("position", "velocity"),
  MountainCarContinuous = c("position", "velocity"),
  Pendulum = c("cos_theta", "sin_theta", "angular_velocity"),
  Taxi = "state"
)

# Falls back to numbers where the environment is unknown or a wrapper has
# changed what it shows.
observation_names <- function(env_id, n) {
  family <- sub("-v[0-9]+$", "", if (is.null(env_id)) "" else env_id)
  parts <- observation_parts[[family, exact = TRUE]]
  if (length(parts) == n) parts else paste0("obs_", seq_len(n))
}
