#' Write your own agent
#'
#' An agent finds the weights of a policy. It is a plain list with its own class before
#' `"gym_agent"`, made by a function such as [agent_ars()]. Training calls only these generics. Each
#' returns a value and changes nothing else, so an agent can be saved and resumed. Draw random
#' numbers with R's functions, such as `rnorm()`: training sets R's generator.
#'
#' An iteration is: ask, play each candidate, tell. An agent that follows a gradient has one
#' candidate, its behavior policy, and needs the trajectories. It moves the weights along
#' [policy_log_prob_gradient()].
#'
#' @param agent The agent.
#' @param policy The policy whose weights it finds, bound to the environment: a network, see
#'   [policy_network()].
#' @param results The results of the candidates, a list with the elements
#'   \describe{
#'     \item{weights}{The result of `agent_ask()`.}
#'     \item{returns}{Their mean returns, a numeric vector with an element for each candidate.}
#'     \item{lengths}{The mean lengths of their episodes, in steps, a numeric vector.}
#'     \item{moments}{The moments of all observations in these episodes if the agent needs them,
#'       otherwise `NULL`.}
#'     \item{trajectories}{If the agent needs them, each step of these episodes, episode by episode:
#'       a list with an element (or a row) for each step: `candidate`, `episode` (integers),
#'       `observation`, `action` (in the form of [act()], for many), `reward` (double),
#'       `terminated`, `truncated` (logical; `TRUE` for the last step of an episode that `max_steps`
#'       cuts off) and `next_observation`.}
#'   }
#' @return
#' * `agent_start()`: the agent before its first iteration. The method of `"gym_agent"` keeps the
#'   policy as `agent$policy`.
#' * `agent_ask()`: the candidates to play next, a numeric matrix with the weights of a candidate in
#'   each row, in the order of [coef()][coef.gym_policy_network]. Attributes of the matrix come back
#'   with the results. The method of `"gym_agent"` returns the weights of `agent_behavior()`. With
#'   `NULL` that policy is played as it is.
#' * `agent_tell()`: the updated agent. The method of `"gym_agent"` merges the moments of the
#'   observations into those of `agent$policy`. Begin a method with `agent <- NextMethod()` if
#'   observations may be normalised.
#' * `agent_needs()`: the data that the agent needs, strings: `"returns"`, which it always gets,
#'   `"moments"` and `"trajectories"`. The method of `"gym_agent"` returns `"returns"`, and
#'   `"moments"` if its policy has `normalize = TRUE`.
#' * `agent_policy()`: the policy with the agent's current weights, which need not be those of the
#'   best candidate. The method of `"gym_agent"` returns `agent$policy`.
#' * `agent_behavior()`: the policy whose candidates are played; a method may draw random numbers to
#'   choose it. The method of `"gym_agent"` returns `agent_policy(agent)`. If this policy is not a
#'   network (a [policy_random()], for example), it is played as it is, and `agent_ask()` is not
#'   called.
#' * `agent_episodes()`: the number of episodes of each candidate in this iteration. The method of
#'   `"gym_agent"` returns `episodes`, the argument of [train_agent()].
#' * `agent_log()`: numbers about the last iteration for the history and the log, a numeric vector
#'   whose names are always the same. The method of `"gym_agent"` returns an empty one.
#' @param episodes The argument `episodes` of [train_agent()].
#' @export
#' @examples
#' # Take a step in a random direction, and keep it if the return is no worse.
#' agent_walk <- function(size = 0.1) {
#'   structure(list(size = size, best = -Inf), class = c("walk", "gym_agent"))
#' }
#' agent_ask.walk <- function(agent) {
#'   w <- coef(agent_policy(agent))
#'   rbind(w + rnorm(length(w), sd = agent$size))
#' }
#' agent_tell.walk <- function(agent, results) {
#'   agent <- NextMethod()
#'   if (results$returns >= agent$best) {
#'     agent$best <- results$returns
#'     coef(agent$policy) <- results$weights[1, ]
#'   }
#'   agent
#' }
agent_start <- function(agent, policy) UseMethod("agent_start")

#' @rdname agent_start
#' @export
agent_ask <- function(agent) UseMethod("agent_ask")

#' @rdname agent_start
#' @export
agent_tell <- function(agent, results) UseMethod("agent_tell")

#' @rdname agent_start
#' @export
agent_policy <- function(agent) UseMethod("agent_policy")

#' @rdname agent_start
#' @export
agent_behavior <- function(agent) UseMethod("agent_behavior")

#' @rdname agent_start
#' @export
agent_episodes <- function(agent, episodes) UseMethod("agent_episodes")

#' @rdname agent_start
#' @export
agent_log <- function(agent) UseMethod("agent_log")

#' @rdname agent_start
#' @export
agent_needs <- function(agent) UseMethod("agent_needs")

#' @export
agent_needs.gym_agent <- function(agent) {
  c("returns", if (!is.null(agent_policy(agent)$moments)) "moments")
}

#' @export
agent_start.gym_agent <- function(agent, policy) {
  agent$policy <- policy
  agent
}

#' @export
agent_tell.gym_agent <- function(agent, results) {
  if (!is.null(agent$policy$moments)) {
    agent$policy$moments <- merge_moments(agent$policy$moments, results$moments)
  }
  agent
}

#' @export
agent_ask.gym_agent <- function(agent) rbind(stats::coef(agent_behavior(agent)))

#' @export
agent_policy.gym_agent <- function(agent) agent$policy

#' @export
agent_behavior.gym_agent <- function(agent) agent_policy(agent)

#' @export
agent_episodes.gym_agent <- function(agent, episodes) episodes

#' @export
agent_log.gym_agent <- function(agent) numeric()

# The policy of an agent if none is given.
default_policy <- function(agent) UseMethod("default_policy")

#' @exportS3Method
default_policy.gym_agent <- function(agent) policy_linear()

# Makes an agent of this package. `shared` are classes with methods that several agents share.
new_agent <- function(class, settings, shared = NULL) {
  structure(settings, class = c(paste0("gym_agent_", class), shared, "gym_agent"))
}

#' @export
print.gym_agent <- function(x, ...) print_lines(x, paste0("<agent: ", format(x), ">"))

#' @export
format.gym_agent <- function(x, ...) class(x)[[1L]]

# "ARS V2-t, 8 directions": an agent's name, then its settings as name and value, without schedules.
agent_text <- function(name, settings) {
  settings <- Filter(Negate(is.function), settings)
  values <- vapply(settings, number_text, "")
  paste0(name, ": ", paste(names(settings), values, sep = " ", collapse = ", "))
}
