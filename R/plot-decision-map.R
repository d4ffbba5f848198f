#' Map what a policy does
#'
#' Ask a policy for its actions on a grid of values of two parts of the observation. The other parts
#' stay constant. [plot()][plot.gym_decision_map()] shows the map. Nothing is played, unless `path =
#' TRUE`.
#'
#' # What is shown
#'
#' - A network with one output and two actions: the output, scaled to the range from 0 to 1. The
#'   action changes at one half.
#' - A network with the output `"softmax"` and two actions: the probability of the second one.
#' - Any other policy with discrete actions: the action. A function is called as in [act()]. A
#'   network that draws its actions shows the most likely one.
#' - Actions of a Box: the action, or, if it has several numbers, the one that `action` selects.
#'
#' For Discrete observations the map has the action in each state, and the other arguments are
#' ignored. [plot()][plot.gym_state_map()] shows it on the grid of FrozenLake, CliffWalking or Taxi.
#' The action is `NA` in two kinds of states: those in which, by the environment's model (see
#' [env_model()]), no episode chooses an action; and those in which all values of a table are equal,
#' because they were never visited.
#'
#' If observations have several parts with few values each, like Blackjack's, the map has the action
#' in each state, and its value if the policy is a table. `x` and `y` are the first two parts by
#' default. `at` holds a part constant, and each value of any other part has its own panel:
#' `plot(decision_map("Blackjack-v1", policy, "dealer_card", "player_sum"))`.
#'
#' # Ranges
#'
#' `xlim` and `ylim` set the ranges. By default, CartPole's positions have the range in which an
#' episode goes on, and its velocities have the range of balanced and falling poles. In other
#' environments, each part has the range of the path. Without a path, it has its bounds in the
#' observation space. If a part has no bounds, give a range or a path.
#'
#' @param env The environment, which supplies the names of observations and the meanings of actions:
#'   an id, such as `"CartPole-v1"`, the result of [gym_wrap()], or an environment made by
#'   [gym_make()], which is not changed. It may be `NULL`, the default, for a network that was
#'   played before. For any other network, `NULL` names the inputs `obs_1`, `obs_2`, ...
#' @param policy The policy: a network, made by [policy_network()] or found by a search, or a
#'   function of many observations as for [rollout()].
#' @param x,y The two parts of the observation to map: their names, such as `"pole_angle"`, or
#'   numbers from 1. Required if there are more than two.
#' @param at The values of the other parts: a numeric vector with their names, such as
#'   `c(cart_position = 1)`. By default a part is 0, or the middle of its bounds if these exclude 0.
#' @param path Episodes to show on the map: the result of [rollout()] with `steps = TRUE`, or a data
#'   frame of steps like its own; `TRUE` to play one episode of the policy in `env`; or `NULL`, the
#'   default, for no path. Note that along the path the other parts change, too, while the map holds
#'   them constant.
#' @param xlim,ylim The ranges, numeric vectors of length 2, or `NULL`, the default.
#' @param action Which number of an action to map, if an action is a Box of several numbers. A whole
#'   number from 1, the default.
#' @param size The number of points in each direction, a whole number of at least 2. The default
#'   is 101.
#' @param seed A whole number that fixes the episode played with `path = TRUE` and leaves the
#'   session's generator as it was. `NULL`, the default, draws a seed from the session's generator.
#' @param client The client of the server that is asked about an environment given by its id. The
#'   default is the session's client, [gym_client()].
#' @return An object of class `gym_decision_map`, with methods for [print()], [as.data.frame()] and
#'   [plot()][plot.gym_decision_map()]. It is a list with the elements
#'   \describe{
#'   \item{grid}{A data frame with one row for each point: the two parts, under their names, and
#'   `output` (double, from 0 to 1, if `kind` is `"output"`) or `action` (integer or double).
#'   `as.data.frame()` returns it.}
#'   \item{x, y}{The names of the two parts, strings.}
#'   \item{kind}{What is mapped, a string: `"output"`, `"choice"`, `"value"`, `"state"` or
#'   `"parts"`. A map of kind `"parts"` also has `panels`, the names of the parts that are on no
#'   axis.}
#'   \item{at}{The values of the other parts, a named numeric vector.}
#'   \item{path}{The path, a data frame of `episode`, `x` and `y`, or `NULL`.}
#'   \item{actions}{The names of the actions, strings; for a Box the name of the number.}
#'   \item{limits}{The bounds of an action that is a Box, otherwise `NULL`.}
#'   \item{env_id, policy}{The environment's id, `NULL` if it is unknown, and the policy.}
#'   }
#' @section Errors: `gym_error_argument` if there is nothing to map (a policy that draws its
#'   actions, observations that are not at least two numbers, actions that are neither discrete nor
#'   a Box), for a name that the observation does not have, or for an unknown range.
#' @references CartPole's ranges: an episode ends beyond 2.4 in position and 12 degrees in angle,
#'   see <https://gymnasium.farama.org/environments/classic_control/cart_pole/>.
#' @export
#' @examples
#' follow <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 0.3), nrow = 1)))
#' map <- decision_map(policy = follow, x = 3, y = 4, xlim = c(-0.2, 0.2), ylim = c(-3, 3))
#' map
#' plot(map)
#'
#' @examplesIf gym:::can_start_server()
#' policy <- search_random("CartPole-v0", seed = 1)$policy
#' map <- decision_map("CartPole-v0", policy, "pole_angle", "pole_angular_velocity",
#'                     path = TRUE, seed = 1)
#' plot(map)
#' head(as.data.frame(map))
decision_map <- function(env = NULL, policy, x = NULL, y = NULL, at = NULL, path = NULL,
                         xlim = NULL, ylim = NULL, action = 1, size = 101, seed = NULL,
                         client = gym_client()) {
  if (missing(policy) || inherits(env, c("gym_policy", "gym_training")) || is.function(env)) {
    abort_wrong("policy", NULL, rlang::current_env(),
                if (missing(policy)) "`policy` is missing." else "`env` must be an environment.",
                i = "The environment comes first, as in `decision_map(\"CartPole-v1\", policy)`;
                     without one it is `decision_map(policy = policy)`.")
  }
  policy <- trained_policy(policy)
  check_policy(policy)
  if (inherits(policy, "gym_policy_random")) {
    abort_wrong("policy", policy, rlang::current_env(),
                "There is nothing to map: a random policy ignores the observation.")
  }
  xlim <- plain_numbers(xlim)
  ylim <- plain_numbers(ylim)
  check_limits(xlim)
  check_limits(ylim)
  check_count(action)
  check_count(size, min = 2)
  check_seed(seed)
  place <- mapped_place(env, policy, client)
  if (is_counted(place$observation_space)) {
    return(counted_map(
      place, env, client, x, y, xlim, ylim, plain_numbers(at), rlang::current_env()
    ))
  }
  observed <- mapped_observation(place)
  axes <- mapped_axes(observed, x, y)
  if (isTRUE(path)) path <- play_path(env, policy, seed, client)
  way <- if (!is.null(path)) path_points(path, observed$names[axes])
  xlim <- xlim %||% mapped_range(observed, axes[[1L]], way$x, "xlim")
  ylim <- ylim %||% mapped_range(observed, axes[[2L]], way$y, "ylim")
  held <- held_at(observed, axes, at)
  points <- expand.grid(
    x = seq(xlim[[1L]], xlim[[2L]], length.out = size),
    y = seq(ylim[[1L]], ylim[[2L]], length.out = size), KEEP.OUT.ATTRS = FALSE
  )
  values <- matrix(held, nrow(points), length(held), byrow = TRUE)
  values[, axes] <- as.matrix(points)
  decided <- decide(place, values, action)
  grid <- stats::setNames(points, observed$names[axes])
  grid[[if (decided$kind == "output") "output" else "action"]] <- decided$values
  structure(class = "gym_decision_map", list(
    grid = grid, x = observed$names[[axes[[1L]]]], y = observed$names[[axes[[2L]]]],
    kind = decided$kind, at = held[-axes], path = way, actions = decided$actions,
    limits = decided$limits, env_id = place$env_id,
    wrappers = place$wrappers, policy = place$policy
  ))
}

check_limits <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  two <- is.numeric(x) && length(x) == 2L && all(is.finite(x))
  if (!is.null(x) && !(two && x[[1L]] < x[[2L]])) {
    abort_argument(x, "two numbers, the lower first, or NULL", arg, call)
  }
}

# The environment ------------------------------------------------------------------

#' Find out where a policy acts
#' @return A list: `policy`, bound if possible, `observation_space`, `action_space`, `env_id`, each
#'   `NULL` if it is unknown.
#' @noRd
mapped_place <- function(env, policy, client, call = rlang::caller_env()) {
  if (!is.null(env)) {
    known <- known_spaces(env, client, call)
    policy <- policy_bind(policy, known, call = call)
    return(list(
      policy = policy, observation_space = known$observation_space,
      action_space = known$action_space, env_id = known$spec$id, wrappers = known$spec$wrappers
    ))
  }
  played <- inherits(policy, "gym_policy_model") && !is.null(policy$observation_space)
  # A network that was not played may not know its sizes yet.
  sized <- inherits(policy, "gym_policy_network") && !anyNA(policy$sizes)
  if (!sized && !played) {
    abort_wrong("env", env, call,
                "Without `env` a decision map needs a network that knows its sizes, or a model that
                 was played, not {policy_text(policy)}.",
                i = "Give the environment, as in `decision_map(\"CartPole-v1\", policy, x = , y =
                     )`.")
  }
  c(list(policy = policy), policy[c("observation_space", "action_space", "env_id", "wrappers")])
}

# The actions ----------------------------------------------------------------------

#' Ask a policy for its actions on many observations
#' @param values A matrix with an observation in each row.
#' @return A list: `kind`, `values`, `actions`, `limits`, as [decision_map()] describes them.
#' @noRd
decide <- function(place, values, action, call = rlang::caller_env()) {
  space <- place$action_space
  outputs <- if (inherits(place$policy, "gym_policy_network")) {
    network_outputs(place$policy, values, call)
  }
  if (inherits(space, "gym_space_box")) {
    n <- prod(space$shape)
    check_count(action, max = n, call = call)
    numbers <- number_rows(policy_actions(place, values, outputs))
    limits <- c(space$low[[action]], space$high[[action]])
    return(list(
      kind = "value", values = as.numeric(numbers[, action]),
      actions = action_parts(place$env_id, n)[[action]], limits = if (all(is.finite(limits))) limits
    ))
  }
  if (!is.null(space) && !inherits(space, "gym_space_discrete")) {
    abort_wrong("policy", place$policy, call,
                "A decision map shows actions that are discrete or a Box, not of {format(space)}.")
  }
  n <- space$n %||% max(2L, ncol(outputs))
  actions <- action_names(place$env_id, n, space$start %||% 0L)
  two <- !is.null(outputs) && n == 2L
  # Show the output itself if a single bounded output chooses between two actions.
  shown <- if (two && identical(place$policy$output, "softmax")) {
    softmax_rows(outputs)[, 2L]
  } else if (two && ncol(outputs) == 1L && has_range(place$policy)) {
    unit_outputs(outputs[, 1L], output_activation(place$policy))
  }
  list(
    kind = if (is.null(shown)) "choice" else "output", actions = actions,
    values = shown %||% as.integer(policy_actions(place, values, outputs))
  )
}

# Calls a function in the same way as a rollout does.
policy_actions <- function(place, values, outputs) {
  if (!is.null(outputs)) {
    return(network_action(place$action_space, outputs, greedy_policy(place$policy), one = FALSE))
  }
  shape <- place$observation_space$shape
  observation <- shape_values(as.vector(t(values)), c(nrow(values), shape))
  observation <- named_batch(place$observation_space, observation)
  vector_env <- place[c("observation_space", "action_space")]
  vector_env$call <- rlang::caller_env()
  act_batch(place$policy, observation, nrow(values), vector_env)
}

# Printing -------------------------------------------------------------------------

#' @export
as.data.frame.gym_decision_map <- function(x, row.names = NULL, optional = FALSE, ...) x$grid

#' @export
print.gym_decision_map <- function(x, ...) {
  size <- sqrt(nrow(x$grid))
  decided <- sum(!is.na(x$grid$action))
  of_all <- if (decided < nrow(x$grid)) paste(decided, "of ")
  states <- paste0(of_all, count_of(nrow(x$grid), "state"))
  shows <- switch(
    x$kind, state = paste("the action in", states),
    parts = paste0("the action by ", x$x, " and ", x$y, if (length(x$panels)) {
      paste0(", for each ", paste(x$panels, collapse = " and "))
    }, ", ", states),
    paste0(x$x, " by ", x$y, ", ", size, " x ", size, " points")
  )
  few <- utils::head(x$at, 4L)
  held <- paste(names(few), "=", number_text_each(few), collapse = ", ")
  more <- if (length(x$at) > 4L) paste(", and", length(x$at) - 4L, "more")
  print_lines(x, c(
    paste0("Decision map", if (!is.null(x$env_id)) paste0(" in ", env_text(x)), ": ", shows),
    paste0("Policy: ", policy_text(x$policy)), if (length(x$at)) paste0("Held: ", held, more)
  ))
}
