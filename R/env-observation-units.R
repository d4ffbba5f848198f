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
  LunarLander = c(angle = "rad"),
  MountainCar = c(position = "m"),
  MountainCarContinuous = c(position = "m"),
  Pendulum = c(angular_velocity = "rad/s")
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
  LunarLander = list(
    x = list(at = c(-1, 1), kind = "failure", text = "fails at \u00b11")
  ),
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
