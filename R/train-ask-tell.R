#' Write an agent of your own
#'
#' An agent finds the weights of a policy. It is a plain list with a class of its own before
#' `"gym_agent"`, made by a function such as [agent_ars()], and these generics are all that
#' training asks of it. Each returns a value and changes nothing else, so that an agent can be kept
#' in a file and go on from there. What is drawn is drawn from R's generator, which training sets.
#'
#' An iteration is: ask, play each candidate, tell. An agent that follows a gradient has one
#' candidate, the policy that it behaves by, and needs the trajectories;
#' [policy_log_prob_gradient()] is what it climbs.
#'
#' @param agent The agent.
#' @param policy The policy whose weights it finds, fitted to the environment: a network, see
#'   [policy_network()].
#' @param results What came of playing the candidates, a list with the elements
#'   \describe{
#'     \item{weights}{What `agent_ask()` returned.}
#'     \item{returns}{Their mean returns, a numeric vector with an element for each candidate.}
#'     \item{lengths}{The mean lengths of their episodes, in steps, a numeric vector.}
#'     \item{moments}{The moments of all observations in these episodes, where the agent needs them;
#'       else `NULL`.}
#'     \item{trajectories}{Each step of these episodes, where the agent needs them, one episode's
#'       after the other's: a list with an element (or a row) for each step: `candidate`, `episode`
#'       (integers), `observation`, `action` (as [act()] takes and returns them, for many), `reward`
#'       (double), `terminated`, `truncated` (logical; of an episode that `max_steps` cuts short the
#'       last step is truncated) and `next_observation`.}
#'   }
#' @return
#' * `agent_start()`: the agent as it is before its first iteration. The method of `"gym_agent"`
#'   keeps the policy as `agent$policy`.
#' * `agent_ask()`: the candidates to play next, a numeric matrix with the weights of a candidate in
#'   each row, in the order of [coef()][coef.gym_policy_network]. What the agent wants to know again
#'   when it is told the results may be attributes of the matrix. The method of `"gym_agent"` asks
#'   for the weights of `agent_behavior()`.
#' * `agent_tell()`: the agent, wiser. The method of `"gym_agent"` merges the moments of the
#'   observations into those of `agent$policy`; a method begins with `agent <- NextMethod()` where
#'   observations may be normalised.
#' * `agent_needs()`: what the agent needs of the playing, strings: `"returns"`, which it always
#'   gets, `"moments"` and `"trajectories"`. The method of `"gym_agent"` returns `"returns"`, and
#'   `"moments"` where its policy has `normalize = TRUE`.
#' * `agent_policy()`: the policy with the agent's current weights, which need not be those of the
#'   best candidate. The method of `"gym_agent"` returns `agent$policy`.
#' * `agent_behavior()`: the policy whose candidates are played, the book's behavior policy. The
#'   method of `"gym_agent"` returns `agent_policy(agent)`. Where it is no network, as a
#'   [policy_random()] is none, it is played itself, and `agent_ask()` is not called.
#' * `agent_episodes()`: how many episodes each candidate plays in this iteration. The method of
#'   `"gym_agent"` returns `episodes`, as [train_agent()] was given them.
#' * `agent_log()`: what the history and the log keep of the last iteration, a numeric vector whose
#'   names are always the same. The method of `"gym_agent"` returns none.
#' @param episodes How many episodes [train_agent()] was asked to play with each candidate.
#' @export
#' @examples
#' # Steps in a random direction, kept where they are no worse.
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

# What an agent learns where no policy is given.
default_policy <- function(agent) UseMethod("default_policy")

#' @exportS3Method
default_policy.gym_agent <- function(agent) policy_linear()

#' @export
print.gym_agent <- function(x, ...) {
  cat("<agent: ", format(x), ">\n", sep = "")
  invisible(x)
}

#' @export
format.gym_agent <- function(x, ...) class(x)[[1L]]

# "ARS V2-t, 8 directions": what an agent is called, then its settings as name and value.
agent_text <- function(name, settings) {
  values <- vapply(settings, number_text, "")
  paste0(name, ": ", paste(names(settings), values, sep = " ", collapse = ", "))
}
