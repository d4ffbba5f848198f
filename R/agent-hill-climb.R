#' Hill climbing
#'
#' Adds noise to the best weights so far, uniformly from `-noise` to `noise`, and keeps what does
#' better. It sticks where the best weights were lucky, or where all weights nearby do equally
#' badly.
#'
#' @param noise How far from the best weights a candidate may be in each weight, a number above 0.
#' @param candidates How many candidates are played in an iteration, a whole number of at least 1;
#'   the default is 1.
#' @return An agent of class `gym_agent_hill_climb`. Its policy has the best weights so far.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be.
#' @references K. Frans (2016), Simple reinforcement learning methods to learn CartPole,
#'   <https://kvfrans.com/simple-algoritms-for-solving-cartpole/>.
#' @seealso [agent_ars()], [agent_cem()]; [agent_ask()] for what an agent is.
#' @export
#' @examples
#' agent_hill_climb()
#' agent_hill_climb(noise = 0.5, candidates = 8)
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
