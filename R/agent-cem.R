#' The cross-entropy method
#'
#' Draw the candidates of an iteration from a normal distribution of the weights, in which weights
#' are independent. The mean and standard deviation of the best candidates, the elite, become those
#' of the next iteration (Szita and Lorincz 2006). An extra noise, which decreases to 0, is added to
#' the variance. Without it the distribution soon becomes so narrow that the search gets stuck.
#'
#' The weights of the agent's policy are the mean of the distribution. The first mean is the weights
#' that the policy has when training begins.
#'
#' @param population The number of candidates per iteration, a whole number of at least 2.
#' @param elite How many of them are the elite, a whole number from 1 to `population`. The default
#'   is a fifth of them.
#' @param noise The standard deviation of the first distribution, a number above 0.
#' @param extra_noise The standard deviation of the extra noise in the first iteration, a number of
#'   at least 0.
#' @param extra_iterations The number of iterations after which the extra noise is 0, a whole number
#'   of at least 1. Its variance decreases by the same amount in each.
#' @inheritParams agent_ars
#' @return `agent_cem()` returns an agent of class `gym_agent_cem`. `search_cem()` makes this agent,
#'   trains it and returns the result of [train_agent()].
#' @section Errors: `gym_error_argument` for an invalid argument.
#' @references I. Szita and A. Lorincz (2006), Learning Tetris using the noisy cross-entropy method,
#'   Neural Computation 18(12), 2936-2941.
#' @seealso [agent_ars()], [agent_hill_climb()]; [agent_ask()] explains what an agent is.
#' @export
#' @examples
#' agent_cem()
#' agent_cem(population = 100, elite = 10)
#' @examplesIf gym:::can_start_server()
#' search_cem("CartPole-v1", policy_network(), iterations = 20, seed = 1)
agent_cem <- function(population = 40, elite = max(1, population %/% 5), noise = 1,
                      extra_noise = 1, extra_iterations = 20) {
  check_count(population, min = 2)
  check_count(elite, max = population)
  check_above_zero(noise)
  check_number(extra_noise, min = 0)
  check_count(extra_iterations)
  structure(
    list(
      population = as.integer(population), elite = as.integer(elite), noise = noise,
      extra_noise = extra_noise, extra_iterations = as.integer(extra_iterations), iteration = 0L,
      deviation = NULL, policy = NULL
    ),
    class = c("gym_agent_cem", "gym_agent")
  )
}

#' @export
agent_start.gym_agent_cem <- function(agent, policy) {
  agent <- NextMethod()
  agent$deviation <- rep(agent$noise, length(stats::coef(policy)))
  agent$iteration <- 0L
  agent
}

#' @export
agent_ask.gym_agent_cem <- function(agent) {
  mean <- stats::coef(agent$policy)
  left <- max(0, 1 - agent$iteration / agent$extra_iterations)
  deviation <- sqrt(agent$deviation^2 + agent$extra_noise^2 * left)
  n <- agent$population
  drawn <- matrix(stats::rnorm(n * length(mean)), n, length(mean))
  rep(mean, each = n) + drawn * rep(deviation, each = n)
}

#' @export
agent_tell.gym_agent_cem <- function(agent, results) {
  agent <- NextMethod()
  best <- order(-results$returns)[seq_len(agent$elite)]
  elite <- results$weights[best, , drop = FALSE]
  mean <- colMeans(elite)
  coef(agent$policy) <- mean
  # A single candidate has no standard deviation, and with 0 all candidates would be the same.
  if (agent$elite > 1L) {
    agent$deviation <- sqrt(colMeans((elite - rep(mean, each = agent$elite))^2))
  }
  agent$iteration <- agent$iteration + 1L
  agent
}

#' @export
format.gym_agent_cem <- function(x, ...) {
  agent_text("CEM", x[c("population", "elite", "noise", "extra_noise", "extra_iterations")])
}

#' @rdname agent_cem
#' @export
search_cem <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_cem", env, policy = policy, ...)
}
