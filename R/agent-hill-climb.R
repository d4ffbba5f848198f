#' Hill climbing
#'
#' Add uniform noise from `-noise` to `noise` to the best weights so far, and keep the result if it
#' does better. The search gets stuck if the best weights were lucky, or if all weights nearby do
#' equally badly.
#'
#' @param noise The largest distance of a candidate from the best weights, in each weight, a number
#'   above 0.
#' @param candidates The number of candidates per iteration, a whole number of at least 1. The
#'   default is 1.
#' @inheritParams agent_ars
#' @return `agent_hill_climb()` returns an agent of class `gym_agent_hill_climb`, whose policy has
#'   the best weights so far. `search_hill_climb()` makes this agent, trains it and returns the
#'   result of [train_agent()].
#' @section Errors: `gym_error_argument` for an invalid argument.
#' @references K. Frans (2016), Simple reinforcement learning methods to learn CartPole,
#'   <https://kvfrans.com/simple-algoritms-for-solving-cartpole/>.
#' @seealso [agent_ars()], [agent_cem()]; [agent_ask()] explains what an agent is.
#' @export
#' @examples
#' agent_hill_climb()
#' agent_hill_climb(noise = 0.5, candidates = 8)
#' @examplesIf gym:::can_start_server()
#' search_hill_climb("CartPole-v1", candidates = 8, iterations = 20, seed = 1)
agent_hill_climb <- function(noise = 0.1, candidates = 1) {
  check_above_zero(noise)
  check_count(candidates)
  structure(
    list(
      noise = noise, candidates = as.integer(candidates), best_return = -Inf, policy = NULL
    ),
    class = c("gym_agent_hill_climb", "gym_agent")
  )
}

#' @export
agent_start.gym_agent_hill_climb <- function(agent, policy) {
  agent <- NextMethod()
  agent$best_return <- -Inf
  agent
}

#' @export
agent_ask.gym_agent_hill_climb <- function(agent) {
  weights <- stats::coef(agent$policy)
  n <- agent$candidates
  away <- matrix(stats::runif(n * length(weights), -agent$noise, agent$noise), n)
  rep(weights, each = n) + away
}

#' @export
agent_tell.gym_agent_hill_climb <- function(agent, results) {
  agent <- NextMethod()
  best <- which.max(results$returns)
  if (results$returns[[best]] > agent$best_return) {
    agent$best_return <- results$returns[[best]]
    coef(agent$policy) <- results$weights[best, ]
  }
  agent
}

#' @export
format.gym_agent_hill_climb <- function(x, ...) {
  agent_text("hill climbing", c(x["noise"], if (x$candidates > 1L) x["candidates"]))
}

#' @rdname agent_hill_climb
#' @export
search_hill_climb <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_hill_climb", env, policy = policy, ...)
}
