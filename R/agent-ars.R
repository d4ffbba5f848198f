#' Augmented random search
#'
#' Take steps along random directions, weighted by how much better the policy is in the direction
#' than against it (Mania, Guy and Recht 2018, Algorithm 2). Each iteration draws `directions`
#' directions from the standard normal distribution. It plays two policies for each direction: the
#' current weights plus and minus `noise` times the direction. It ranks directions by the better of
#' their two returns and keeps the `top` best. The step is `step_size` times the sum of (return with
#' plus - return with minus) times direction, divided by `top` and by the standard deviation of the
#' returns used (the one that divides by their number).
#'
#' The versions are the paper's:
#'
#' | version | observations | directions used |
#' |---|---|---|
#' | V1 | as they are | all |
#' | V1-t | as they are | the `top` ones |
#' | V2 | normalised | all |
#' | V2-t | normalised | the `top` ones |
#'
#' A policy made with `normalize = TRUE` normalises observations in V1, too. It clips them at its
#' `clip_obs`. Otherwise V2 does not clip them, as in the paper.
#'
#' As in the authors' code, the weights stay as they are if all returns used are equal, and an
#' element of an observation that has never changed becomes 0. If directions tie, the authors' code
#' keeps all of them; this function keeps the first ones.
#'
#' @param directions The number of directions per iteration, a whole number of at least 1. An
#'   iteration plays twice as many candidates.
#' @param top The number of directions that the step uses, a whole number from 1 to `directions`.
#'   The default is half of them.
#' @param step_size The step size, a number above 0.
#' @param noise The distance of candidates from the weights, a number above 0.
#' @param version One of `"V1"`, `"V1-t"`, `"V2"` and `"V2-t"` (the default).
#' @param shift A number that training subtracts from the reward of each step. The paper uses it for
#'   environments that reward survival, such as Hopper, which pays 1 per step. The default is 0.
#' @param env The environment, as for [train_agent()]. If it is an id with a row in
#'   [agent_presets()], that row supplies the settings that you do not give. A message says so.
#' @param policy The policy. `NULL`, the default, uses the preset's policy, or [policy_linear()].
#' @param ... Arguments of the agent, as above; of [train_agent()], such as `iterations`,
#'   `total_steps`, `target`, `seed` or `checkpoint`; and of the environment, such as
#'   `continuous = TRUE` for LunarLander. Without a preset a budget is needed: `iterations` or
#'   `total_steps`.
#' @return `agent_ars()` returns an agent of class `gym_agent_ars`. `search_ars()` makes this agent,
#'   trains it and returns the result of [train_agent()].
#' @section Errors: `gym_error_argument` for an invalid argument.
#' @references H. Mania, A. Guy and B. Recht (2018), Simple random search of static linear policies
#'   is competitive for reinforcement learning, NeurIPS 31. Code:
#'   <https://github.com/modestyachts/ARS>.
#' @seealso [agent_cem()], [agent_hill_climb()]; [agent_ask()] explains what an agent is.
#' @export
#' @examples
#' agent_ars()
#' agent_ars(directions = 32, top = 4, step_size = 0.02, noise = 0.03)
#' @examplesIf gym:::can_start_server()
#' search_ars("CartPole-v1", seed = 1)
agent_ars <- function(directions = 8, top = max(1, directions %/% 2), step_size = 0.02,
                      noise = 0.05, version = "V2-t", shift = 0) {
  check_count(directions)
  check_choice(version, c("V1", "V1-t", "V2", "V2-t"))
  if (!missing(top) && !endsWith(version, "-t") && !identical(top + 0, directions + 0)) {
    must <- paste0("the number of directions in version ", version, ", which uses all of them; \"",
                   version, "-t\" uses the best")
    abort_argument(top, must, "top", rlang::current_env())
  }
  check_count(top, max = directions)
  check_above_zero(step_size)
  check_above_zero(noise)
  check_number(shift)
  new_agent("ars", list(
    directions = as.integer(directions),
    top = if (endsWith(version, "-t")) as.integer(top) else as.integer(directions),
    step_size = step_size, noise = noise, version = version, shift = shift, policy = NULL
  ))
}

#' @export
agent_start.gym_agent_ars <- function(agent, policy) {
  agent <- NextMethod()
  if (startsWith(agent$version, "V2")) {
    abort_if(
      inherits(policy$observation_space, "gym_space_discrete"), "version", agent$version, NULL,
      "ARS {agent$version} normalizes observations, and those of {env_text(policy)} are
       {format(policy$observation_space)}.",
      i = '`version = "{sub("V2", "V1", agent$version)}"` leaves them unchanged.'
    )
    if (is.null(policy$moments)) {
      agent$policy$moments <- no_moments()
      # The paper's policy is linear in the normalised observations.
      agent$policy$clip_obs <- Inf
    }
  }
  agent
}

#' @export
agent_ask.gym_agent_ars <- function(agent) {
  weights <- stats::coef(agent$policy)
  count <- length(weights)
  directions <- matrix(stats::rnorm(agent$directions * count), agent$directions, count)
  # In the order: plus and minus the first direction, plus and minus the second, and so on.
  away <- directions[rep(seq_len(agent$directions), each = 2L), , drop = FALSE] *
    c(agent$noise, -agent$noise)
  structure(rep(weights, each = 2L * agent$directions) + away, directions = directions)
}

#' @export
agent_tell.gym_agent_ars <- function(agent, results) {
  agent <- NextMethod()
  returns <- matrix(results$returns - agent$shift * results$lengths, ncol = 2L, byrow = TRUE)
  used <- order(-pmax(returns[, 1L], returns[, 2L]))[seq_len(agent$top)]
  returns <- returns[used, , drop = FALSE]
  deviation <- sqrt(mean((returns - mean(returns))^2))
  if (deviation > 0) {
    directions <- attr(results$weights, "directions")[used, , drop = FALSE]
    gradient <- colSums(directions * (returns[, 1L] - returns[, 2L])) / (agent$top * deviation)
    coef(agent$policy) <- stats::coef(agent$policy) + agent$step_size * gradient
  }
  agent
}

#' @export
format.gym_agent_ars <- function(x, ...) {
  agent_text(
    paste("ARS", x$version),
    c(x[c("directions", if (endsWith(x$version, "-t")) "top", "step_size", "noise")],
      if (x$shift != 0) x["shift"])
  )
}

#' @rdname agent_ars
#' @export
search_ars <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_ars", env, policy = policy, ...)
}
