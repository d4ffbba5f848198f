#' Augmented random search
#'
#' Steps along random directions, each weighted by how much better one does when one goes along it
#' than when one goes against it (Mania, Guy and Recht 2018, Algorithm 2). In each iteration
#' `directions` are drawn from the standard normal distribution, and the policies with `noise` times
#' the direction added to, and subtracted from, the weights are played. Of the `top` directions with
#' the best of the two returns the step is made up: `step_size` times the sum of (return along -
#' return against) times direction, divided by `top` and by the standard deviation of the returns
#' used (the one that divides by their number).
#'
#' The versions are those of the paper:
#'
#' | version | observations | directions used |
#' |---|---|---|
#' | V1 | as they are | all |
#' | V1-t | as they are | the `top` ones |
#' | V2 | normalised | all |
#' | V2-t | normalised | the `top` ones |
#'
#' (A policy that was made with `normalize = TRUE` normalises them in V1, too.)
#'
#' As in the authors' code there is no step where the returns used are all the same, and a number of
#' an observation that has not changed comes in as 0; unlike there, of directions with equal returns
#' the first are used, and not all.
#'
#' @param directions How many directions are drawn, a whole number of at least 1. Twice as many
#'   candidates are played in an iteration.
#' @param top How many of them make up the step, a whole number from 1 to `directions`; the default
#'   is half of them.
#' @param step_size How far the steps go, a number above 0.
#' @param noise How far from the weights the candidates are, a number above 0.
#' @param version The version, one of `"V1"`, `"V1-t"`, `"V2"` and `"V2-t"`, the default.
#' @param shift What is subtracted from the reward of each step in training, a number: where an
#'   environment rewards mere survival, as Hopper does by 1, the paper takes that away. The default
#'   is 0.
#' @param env The environment, as for [train_agent()]. Where it is an id that [agent_presets()] has
#'   a row for, the settings that are not given are taken from there, with a message.
#' @param policy The policy; `NULL`, the default, is the preset's, or [policy_linear()].
#' @param iterations,total_steps,target The budget and the target, as for [train_agent()]; `NULL`,
#'   the default, takes the preset's budget, and the environment's target.
#' @param ... Further arguments of [train_agent()], such as `seed` or `checkpoint`, and the
#'   environment's own, such as `continuous = TRUE` for LunarLander.
#' @return `agent_ars()` an agent of class `gym_agent_ars`; `search_ars()` makes that agent, trains
#'   it and returns what [train_agent()] does.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be.
#' @references H. Mania, A. Guy and B. Recht (2018), Simple random search of static linear policies
#'   is competitive for reinforcement learning, NeurIPS 31. Code:
#'   <https://github.com/modestyachts/ARS>.
#' @seealso [agent_cem()], [agent_hill_climb()]; [agent_ask()] for what an agent is.
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
  structure(
    list(
      directions = as.integer(directions),
      top = if (endsWith(version, "-t")) as.integer(top) else as.integer(directions),
      step_size = step_size, noise = noise, version = version, shift = shift, policy = NULL
    ),
    class = c("gym_agent_ars", "gym_agent")
  )
}

#' @export
agent_start.gym_agent_ars <- function(agent, policy) {
  agent <- NextMethod()
  if (startsWith(agent$version, "V2")) {
    check_can_normalize(agent, policy)
    agent$policy$moments <- policy$moments %||% no_moments()
  }
  agent
}

check_can_normalize <- function(agent, policy) {
  if (inherits(policy$observation_space, "gym_space_discrete")) {
    plain <- sub("V2", "V1", agent$version)
    gym_abort(
      c(paste0("ARS ", agent$version, " normalizes observations, and those of ", policy$env_id,
               " are ", format(policy$observation_space), "."),
        i = paste0("`version = \"", plain, "\"` takes them as they are.")),
      class = "gym_error_argument", argument = "version", value = agent$version, call = NULL
    )
  }
}

#' @export
agent_ask.gym_agent_ars <- function(agent) {
  weights <- stats::coef(agent$policy)
  count <- length(weights)
  directions <- matrix(stats::rnorm(agent$directions * count), agent$directions, count)
  # Along and against the first direction, along and against the second, and so on.
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
search_ars <- function(env = "CartPole-v1", policy = NULL, directions = NULL, top = NULL,
                       step_size = NULL, noise = NULL, version = NULL, shift = NULL,
                       iterations = NULL, total_steps = NULL, target = NULL, ...) {
  make_and_train("agent_ars", rlang::current_env(), ...)
}
