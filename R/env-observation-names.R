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

# Falls back to the names of the columns where the environment is unknown or a
# wrapper has changed what it shows.
observation_names <- function(env_id, columns) {
  parts <- observation_parts[[environment_family(env_id), exact = TRUE]]
  if (length(parts) == length(columns)) parts else columns
}

# Values of one space as the columns of a table -------------------------------------

#' Put values of a space into columns
#'
#' Numbers have a column each, in row-major order; so have the parts of Tuple and
#' Dict. Values that may hold any number of parts have one column that is a list.
#' @param values The values, as [sub_envs_from()] puts them together.
#' @param name What they are, such as `"action"`.
#' @return A named list of columns.
#' @noRd
value_columns <- function(space, values, name) UseMethod("value_columns")

#' @exportS3Method
value_columns.default <- function(space, values, name) stats::setNames(list(I(values)), name)

#' @exportS3Method
value_columns.gym_space_array <- function(space, values, name) {
  numbers <- sub_env_numbers(values)
  n <- ncol(numbers)
  each <- lapply(seq_len(n), function(i) numbers[, i])
  stats::setNames(each, if (n == 1L) name else paste0(name, "_", seq_len(n), recycle0 = TRUE))
}

#' @exportS3Method
value_columns.gym_space_discrete <- function(space, values, name) {
  stats::setNames(list(values), name)
}

#' @exportS3Method
value_columns.gym_space_text <- value_columns.gym_space_discrete

#' @exportS3Method
value_columns.gym_space_tuple <- function(space, values, name) {
  columns <- lapply(seq_along(space$spaces), function(i) {
    value_columns(space$spaces[[i]], values[[i]], paste0(name, "_", names(space$spaces)[i] %||% i))
  })
  do.call(c, columns)
}

#' @exportS3Method
value_columns.gym_space_dict <- value_columns.gym_space_tuple
