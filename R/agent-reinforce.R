#' REINFORCE
#'
#' Play whole episodes with a policy that draws its actions, and make each action more likely in
#' proportion to the discounted return that followed it (Williams 1992; Sutton and Barto 2018,
#' sections 13.3 and 13.4). Each iteration takes one step of Adam along the mean, over all steps, of
#' (return - baseline) times the gradient of the action's log-probability.
#'
#' The baseline is a value network with the policy's hidden layers. After each iteration it is
#' fitted to the returns by `value_updates` steps of Adam. Without a baseline the return itself
#' counts. A truncated episode would have gone on: with a baseline, the value of its last state
#' replaces the later rewards. Without a baseline nothing replaces them, so they are missing from
#' its returns.
#'
#' Sutton and Barto multiply each step by `gamma^t`, so that late steps count less. Only then is it
#' the gradient of the discounted return from the start. Like nearly all implementations, this agent
#' leaves out the factor, because with it the agent would hardly learn from the end of an episode.
#'
#' Iterations, normalised observations and the default policy are those of [agent_ppo()].
#'
#' @param batch_steps The approximate number of steps in an iteration, a whole number. The default
#'   is 1000.
#' @param learning_rate The step size of Adam for the policy, a number above 0, or a function of the
#'   steps so far such as [schedule_linear()]. The default is 0.01.
#' @param gamma The discount, a number from 0 to 1. The default is 0.99.
#' @param baseline Use a baseline? `TRUE`, the default, or `FALSE`.
#' @param value_learning_rate The step size of Adam for the baseline, as `learning_rate`. The
#'   default is 0.01.
#' @param value_updates The number of steps of Adam for the baseline after each iteration, a whole
#'   number. The default is 20.
#' @param entropy The weight of the policy's entropy relative to the return, a number or a function
#'   of the steps so far. The default is 0.
#' @param normalize_advantages Scale the advantages (return - baseline) to mean 0 and standard
#'   deviation 1? `TRUE`, the default, or `FALSE`. The advantage of a single step stays as it is.
#' @param max_grad_norm The largest length of a gradient, a number, or `Inf`, the default.
#' @param min_episodes The smallest number of episodes in an iteration. The default is 8.
#' @inheritParams agent_ars
#' @param policy The policy. `NULL`, the default, uses the preset's policy, or that of
#'   [agent_ppo()].
#' @return `agent_reinforce()` returns an agent of class `gym_agent_reinforce`. `learn_reinforce()`
#'   makes this agent, trains it and returns the result of [train_agent()]. For each iteration its
#'   history and the log have `entropy_loss`, `explained_variance`, `policy_gradient_loss`,
#'   `value_loss` and `learning_rate`.
#' @section Errors: As for [agent_ppo()].
#' @references R. J. Williams (1992), Simple statistical gradient-following algorithms for
#'   connectionist reinforcement learning, Machine Learning 8.
#'
#'   R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second edition,
#'   MIT Press.
#' @seealso [agent_ppo()]; `vignette("own-agent")`, which writes it in thirty lines
#' @export
#' @examples
#' agent_reinforce()
#' @examplesIf gym:::can_start_server()
#' learn_reinforce("CartPole-v1", total_steps = 5000, seed = 1)
agent_reinforce <- function(batch_steps = 1000, learning_rate = 0.01, gamma = 0.99,
                            baseline = TRUE, value_learning_rate = 0.01, value_updates = 20,
                            entropy = 0, normalize_advantages = TRUE, max_grad_norm = Inf,
                            min_episodes = 8) {
  settings <- mget(names(formals()))
  check_count(batch_steps)
  check_count(min_episodes)
  check_schedules(settings, c("learning_rate", "value_learning_rate", "entropy"))
  check_number(gamma, min = 0, max = 1)
  check_flag(baseline)
  check_count(value_updates)
  check_flag(normalize_advantages)
  check_number(max_grad_norm, min = 0)
  new_gradient_agent("reinforce", settings, reinforce_log)
}

reinforce_log <- c(
  "entropy_loss", "explained_variance", "policy_gradient_loss", "value_loss", "learning_rate"
)

#' @export
agent_start.gym_agent_reinforce <- function(agent, policy) {
  agent <- NextMethod()
  check_has_log_prob(policy, "REINFORCE")
  agent$adam <- new_adam(count_weights(policy))
  if (agent$baseline) {
    agent$value <- value_network(policy)
    agent$value_adam <- new_adam(count_weights(agent$value))
  }
  agent
}

#' @export
agent_tell.gym_agent_reinforce <- function(agent, results) {
  if (is_warming_up(agent)) {
    return(end_iteration(agent, results))
  }
  now <- scheduled_settings(agent, c("learning_rate", "value_learning_rate", "entropy"))
  rows <- iteration_rows(agent$policy, results$trajectories)
  n <- length(rows$reward)

  # The discounted return from each step on.
  reward <- rows$reward
  value <- numeric(n)
  if (agent$baseline) {
    value <- expected_values(agent$value, rows$inputs)
    last_value <- expected_values(agent$value, rows$last_inputs) * !rows$terminated[rows$last]
    reward[rows$last] <- reward[rows$last] + agent$gamma * last_value
  }
  return <- sum_backwards(reward, agent$gamma, rows$last)
  advantage <- return - value
  if (agent$normalize_advantages) advantage <- standardized(advantage)

  # A step up the gradient of mean(advantage * log-probability).
  policy <- agent$policy
  weights <- weight_vector(policy)
  forward <- forward_draws(policy, weights, rows$inputs, rows$action)
  draws <- forward$draws
  gradient <- draws_gradient(policy, forward, -advantage / n, -now$entropy / n)
  moved <- adam_step(
    weights, clip_norm(gradient, agent$max_grad_norm), agent$adam, now$learning_rate
  )
  check_finite_weights(moved$weights, agent)
  agent$policy <- with_weights(policy, moved$weights)
  agent$adam <- moved$adam

  if (agent$baseline) {
    # Steps down the gradient of the squared error.
    weights <- weight_vector(agent$value)
    for (update in seq_len(agent$value_updates)) {
      forward <- forward_network(layers_of(agent$value, weights), rows$inputs)
      gradient <- backward_network(forward, 2 / n * (forward$outputs - return))
      moved <- adam_step(weights, gradient, agent$value_adam, now$value_learning_rate)
      weights <- moved$weights
      agent$value_adam <- moved$adam
    }
    check_finite_weights(weights, agent)
    agent$value <- with_weights(agent$value, weights)
  }
  agent$log[] <- c(
    -mean(draws$entropy), if (agent$baseline) explained_variance(value, return) else NA,
    -mean(advantage * draws$log_prob), if (agent$baseline) mean((value - return)^2) else NA,
    now$learning_rate
  )
  end_iteration(agent, results)
}

#' @export
format.gym_agent_reinforce <- function(x, ...) {
  agent_text(
    if (x$baseline) "REINFORCE with baseline" else "REINFORCE",
    x[c("batch_steps", "learning_rate", "gamma")]
  )
}

#' @rdname agent_reinforce
#' @export
learn_reinforce <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_reinforce", env, policy = policy, ...)
}
