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

#' Put the numbers or parts of an action in the order of the space, by their names
#'
#' The names are those of the space or of the documentation, or of the columns of steps.
#' @param space The action space.
#' @param action One action, or a batch of them.
#' @return The action without names. Names that are not known are an error.
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
    # Names of single numbers are labels, as those that predict() gives.
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
#' @param forms The names that are known, a list with an element for each form of them.
#' @param labels Whether names of which none is known are labels of the user's own, such as the
#'   column names that cbind() makes of the names of variables.
#' @return What takes values in the order of the names: integers, or `TRUE` for the order given.
#'   `NULL` if the names are to be refused.
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
