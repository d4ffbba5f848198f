# The meanings of actions, from the sections "Action Space" in Gymnasium's documentation of each
# environment (https://gymnasium.farama.org/environments/).

action_meanings <- list(
  Acrobot = c("torque -1", "no torque", "torque +1"),
  Blackjack = c("stick", "hit"),
  CartPole = c("push left", "push right"),
  CliffWalking = c("up", "right", "down", "left"),
  CliffWalkingSlippery = c("up", "right", "down", "left"),
  FrozenLake = c("left", "down", "right", "up"),
  FrozenLake8x8 = c("left", "down", "right", "up"),
  LunarLander = c("no engine", "left engine", "main engine", "right engine"),
  LunarLanderContinuous = c("main engine", "side engines"),
  MountainCar = c("push left", "no push", "push right"),
  MountainCarContinuous = "force",
  Pendulum = "torque",
  Taxi = c("south", "north", "east", "west", "pick up", "drop off")
)

#' Find the meanings of an environment's actions
#' @param n The number of actions, or of numbers of an action; `NULL` if it is unknown.
#' @return Strings; `NULL` if the environment is unknown or a wrapper has changed the actions.
#' @noRd
action_meaning <- function(env_id, n = NULL) {
  meaning <- action_meanings[[environment_family(env_id), exact = TRUE]]
  if (is.null(n) || length(meaning) == n) meaning
}

# "CartPole" for "CartPole-v1".
environment_family <- function(env_id) sub("-v[0-9]+$", "", env_id %||% "")

#' Name the actions of an environment
#' @param n The number of actions; for a Box, the number of numbers of an action.
#' @param start The first of them.
#' @return Strings such as `"0: push left"`, or only the numbers if the meanings are unknown.
#' @noRd
action_names <- function(env_id, n, start = 0L) {
  number <- as.character(start + seq_len(n) - 1L)
  meaning <- action_meaning(env_id, n)
  if (is.null(meaning)) number else paste0(number, ": ", meaning)
}

#' Name the numbers of an action that is a Box
#' @noRd
action_parts <- function(env_id, n) {
  action_meaning(env_id, n) %||% if (n == 1L) "action" else paste0("action_", seq_len(n))
}

#' Convert actions given by their meaning to numbers
#' @return The actions; values other than text are unchanged.
#' @noRd
numbered_actions <- function(instance, action, call) {
  space <- instance$single_action_space
  if (!is.character(action) || !inherits(space, "gym_space_discrete")) {
    return(action)
  }
  meaning <- action_meaning(instance$spec$id, space$n)
  if (is.null(meaning)) {
    return(action)
  }
  number <- match(sub("^[0-9]+: ", "", action), meaning)
  if (anyNA(number)) {
    names <- action_names(instance$spec$id, space$n, space$start)
    gym_abort(
      c(paste0("There is no action ", describe_value(action[is.na(number)][[1L]]), " in ",
               instance$spec$id, "."),
        i = paste0("Its actions: ", toString(names), ".")),
      class = "gym_error_space", space = space, value = action, path = "", call = call
    )
  }
  as.integer(space$start) + number - 1L
}
