#' Proximal policy optimization
#'
#' Play whole episodes with a policy that draws its actions, estimate how much better each action
#' was than a value network expected, and make the better actions more likely. The agent makes
#' `epochs` passes over the steps in minibatches. If an action's probability has changed by more
#' than `clip`, a further change in this direction brings no gain (Schulman et al. 2017).
#'
#' The policy is a [policy_network()] with the output `"softmax"` for a Discrete action space, or
#' `"gaussian"` for a Box. By default it has two hidden layers of 64 tanh neurons. The value network
#' has the same hidden layers. The loss of a minibatch is that of
#' [Stable-Baselines3](https://stable-baselines3.readthedocs.io/en/master/modules/ppo.html): the
#' clipped objective, minus `entropy` times the policy's entropy, plus `value_weight` times the
#' squared error of the values. Its gradient is clipped to `max_grad_norm` and passed to Adam
#' (Kingma and Ba 2015, with an epsilon of 1e-5).
#'
#' With `epochs = 1, batch = Inf, clip = Inf` this is the advantage actor-critic A2C (Mnih et al.
#' 2016; Huang et al. 2022), with Adam instead of RMSprop.
#'
#' # Iterations
#'
#' An iteration plays whole episodes, so training can resume from any checkpoint with the same
#' result. The number of episodes is fixed before they are played: `batch_steps` divided by the mean
#' length of the last iteration's episodes, rounded, at least `min_episodes` and at most four times
#' the last number. An episode that the environment or `max_steps` truncated would have gone on, so
#' the value of its last state replaces the later rewards. After a terminated episode no reward can
#' follow.
#'
#' If the policy has `normalize = TRUE`, the first iteration plays random episodes to get the first
#' moments of observations. Later observations are added after each iteration's learning.
#'
#' @param batch_steps The approximate number of steps in an iteration, a whole number. The default
#'   is 2048.
#' @param batch The approximate number of steps in a minibatch, a number of at least 1, or `Inf` for
#'   all steps. An iteration is divided into minibatches of nearly equal size. The default is 64.
#' @param epochs The number of passes over the steps of an iteration, a whole number. The default
#'   is 10.
#' @param learning_rate The step size of Adam, a number above 0, or a function of the steps so far
#'   such as [schedule_linear()]. The default is 3e-4.
#' @param gamma The discount, a number from 0 to 1. The default is 0.99.
#' @param lambda How far advantages look ahead, a number from 0 (one step) to 1 (to the end of the
#'   episode). The default is 0.95 (generalized advantage estimation, Schulman et al. 2016).
#' @param clip How far from 1 the ratio of an action's new to its old probability may go before it
#'   no longer counts, a number, a function of the steps so far, or `Inf`. The default is 0.2.
#' @param entropy The weight of the policy's entropy in the loss, a number or a function of the
#'   steps so far. The default is 0.
#' @param value_weight The weight of the squared error of values, a number. The default is 0.5.
#' @param max_grad_norm The largest length of a gradient, a number or `Inf`. The default is 0.5.
#' @param normalize_advantages Scale the advantages of a minibatch to mean 0 and standard deviation
#'   1? `TRUE`, the default, or `FALSE`. The advantage of a single step stays as it is.
#' @param normalize_rewards Divide rewards by the running standard deviation of the discounted
#'   return and clip them at 10? `FALSE`, the default, or `TRUE`. The log shows the original
#'   rewards.
#' @param target_kl `NULL`, the default, or a number. Learning from an iteration stops before a
#'   minibatch in which the estimated Kullback-Leibler divergence from the policy that played is
#'   more than 1.5 times this number.
#' @param min_episodes The smallest number of episodes in an iteration. The default is 8.
#' @inheritParams agent_ars
#' @param policy The policy. `NULL`, the default, uses the preset's policy, or the one described in
#'   the details.
#' @return `agent_ppo()` returns an agent of class `gym_agent_ppo`. `learn_ppo()` makes this agent,
#'   trains it and returns the result of [train_agent()]. For each iteration its history and the log
#'   have `approx_kl`, `clip_fraction`, `entropy_loss`, `explained_variance`, `loss`,
#'   `policy_gradient_loss`, `value_loss` and `learning_rate`, named as in Stable-Baselines3.
#' @section Errors: `gym_error_argument` for an invalid argument, a policy that does not draw its
#'   actions by their probability, or observations that are not vectors. `gym_error_agent` if
#'   weights become infinite or `NaN`; the field `result` is the training with the last finite
#'   weights.
#' @references J. Schulman et al. (2017), Proximal policy optimization algorithms, arXiv:1707.06347.
#'
#'   J. Schulman et al. (2016), High-dimensional continuous control using generalized advantage
#'   estimation, ICLR.
#'
#'   S. Huang et al. (2022), The 37 implementation details of proximal policy optimization, ICLR
#'   Blog Track; A2C is a special case of PPO, arXiv:2205.09123.
#'
#'   V. Mnih et al. (2016), Asynchronous methods for deep reinforcement learning, ICML.
#'
#'   D. P. Kingma and J. Ba (2015), Adam: a method for stochastic optimization, ICLR.
#' @seealso [agent_reinforce()], [agent_dqn()]; [policy_log_prob()] for writing such an agent
#' @export
#' @examples
#' agent_ppo()
#' @examplesIf gym:::can_start_server()
#' learn_ppo("CartPole-v1", batch_steps = 512, total_steps = 2000, seed = 1)
agent_ppo <- function(batch_steps = 2048, batch = 64, epochs = 10, learning_rate = 3e-4,
                      gamma = 0.99, lambda = 0.95, clip = 0.2, entropy = 0, value_weight = 0.5,
                      max_grad_norm = 0.5, normalize_advantages = TRUE, normalize_rewards = FALSE,
                      target_kl = NULL, min_episodes = 8) {
  settings <- mget(names(formals()))
  check_count(batch_steps)
  check_count(min_episodes)
  check_number(batch, min = 1)
  if (is.finite(batch) && batch > batch_steps) {
    must <- paste("at most `batch_steps`,", number_text(batch_steps), "or Inf")
    abort_argument(batch, must, "batch", rlang::current_env())
  }
  check_count(epochs)
  check_schedules(settings, c("learning_rate", "clip", "entropy"))
  for (name in c("gamma", "lambda")) check_number(settings[[name]], min = 0, max = 1, arg = name)
  check_number(value_weight, min = 0)
  check_number(max_grad_norm, min = 0)
  check_flag(normalize_advantages)
  check_flag(normalize_rewards)
  check_number(target_kl, min = 0, allow_null = TRUE)
  new_gradient_agent("ppo", settings, ppo_log)
}

ppo_log <- c(
  "approx_kl", "clip_fraction", "entropy_loss", "explained_variance", "loss",
  "policy_gradient_loss", "value_loss", "learning_rate"
)

#' @export
agent_start.gym_agent_ppo <- function(agent, policy) {
  agent <- NextMethod()
  check_has_log_prob(policy, "PPO")
  agent$value <- value_network(policy)
  agent$return_moments <- NULL
  agent$adam <- new_adam(count_weights(policy) + count_weights(agent$value))
  agent
}

#' @export
agent_tell.gym_agent_ppo <- function(agent, results) {
  if (is_warming_up(agent)) {
    return(end_iteration(agent, results))
  }
  now <- scheduled_settings(agent, c("learning_rate", "clip", "entropy"))
  rows <- iteration_rows(agent$policy, results$trajectories)
  reward <- rows$reward
  if (agent$normalize_rewards) {
    normal <- scale_rewards(reward, rows$last, agent$gamma, agent$return_moments)
    reward <- normal$reward
    agent$return_moments <- normal$moments
  }
  weights <- c(weight_vector(agent$policy), weight_vector(agent$value))

  # Log-probabilities and values by the networks that played. Do not keep the outputs of hidden
  # layers for all steps: they would need much memory, and R would collect garbage more often.
  rows$log_prob <- forward_draws(agent$policy, weights, rows$inputs, rows$action)$draws$log_prob
  value <- expected_values(agent$value, rows$inputs)
  last_value <- expected_values(agent$value, rows$last_inputs)
  after <- next_values(value, last_value, rows$terminated, rows$last)
  # Generalized advantage estimation (Schulman et al. 2016): the temporal-difference errors of an
  # episode, summed up from its end.
  errors <- reward + agent$gamma * after - value
  rows$advantage <- sum_backwards(errors, agent$gamma * agent$lambda, rows$last)
  rows$return <- rows$advantage + value

  epochs <- lapply(seq_len(agent$epochs), function(epoch) {
    draw_minibatches(length(reward), agent$batch)
  })
  learned <- ppo_update(agent$policy, agent$value, weights, agent$adam, rows, epochs, now)
  check_finite_weights(learned$weights, agent)
  of_policy <- seq_len(count_weights(agent$policy))
  agent$policy <- with_weights(agent$policy, learned$weights[of_policy])
  agent$value <- with_weights(agent$value, learned$weights[-of_policy])
  agent$adam <- learned$adam
  agent$log[] <- c(
    learned$log, explained_variance = explained_variance(value, rows$return),
    learning_rate = now$learning_rate
  )[ppo_log]
  end_iteration(agent, results)
}

#' Follow the gradient through all minibatches
#' @param policy,value The networks. Their own weights are ignored.
#' @param weights The weights of both, one after the other.
#' @param rows The steps: `inputs`, `action`, `log_prob`, `advantage` and `return`.
#' @param epochs A list with a list of minibatches, vectors of row numbers, for each epoch.
#' @param settings The arguments of agent_ppo(), without schedules.
#' @return A list: `weights`, `adam`, and `log`, with the divergence of the last epoch, the loss of
#'   the last minibatch, and means of the others.
#' @noRd
ppo_update <- function(policy, value, weights, adam, rows, epochs, settings) {
  log <- list()
  too_far <- FALSE
  for (batches in epochs) {
    divergences <- numeric()
    for (at in batches) {
      batch <- lapply(rows[c("log_prob", "advantage", "return")], `[`, at)
      batch$inputs <- rows$inputs[, at, drop = FALSE]
      action <- rows$action
      batch$action <- if (is.matrix(action)) action[, at, drop = FALSE] else action[at]
      step <- ppo_gradient(policy, value, weights, batch, settings)
      log[[length(log) + 1L]] <- step$log
      divergences <- c(divergences, step$log[["approx_kl"]])
      too_far <- isTRUE(step$log[["approx_kl"]] > 1.5 * settings$target_kl)
      if (too_far) break
      gradient <- clip_norm(step$gradient, settings$max_grad_norm)
      moved <- adam_step(weights, gradient, adam, settings$learning_rate, epsilon = 1e-5)
      weights <- moved$weights
      adam <- moved$adam
    }
    if (too_far) break
  }
  log <- do.call(rbind, log)
  means <- colMeans(log)
  means[["approx_kl"]] <- mean(divergences)
  means[["loss"]] <- log[nrow(log), "loss"]
  list(weights = weights, adam = adam, log = means)
}

#' Differentiate the loss of a minibatch
#' @return A list: `gradient`, of the weights of both networks, and `log`, numbers.
#' @noRd
ppo_gradient <- function(policy, value, weights, batch, settings) {
  n <- length(batch$return)
  of_policy <- forward_draws(policy, weights, batch$inputs, batch$action)
  draws <- of_policy$draws
  of_value <- forward_network(layers_of(value, weights, count_weights(policy)), batch$inputs)
  advantage <- batch$advantage
  if (settings$normalize_advantages) advantage <- standardized(advantage)

  # The objective is the smaller of ratio x advantage and clipped ratio x advantage. If the ratio is
  # beyond the clip in the direction of the advantage, the gradient is 0.
  log_ratio <- draws$log_prob - batch$log_prob
  ratio <- exp(log_ratio)
  clipped <- pmin.int(pmax.int(ratio, 1 - settings$clip), 1 + settings$clip)
  objective <- pmin.int(ratio * advantage, clipped * advantage)
  counts <- (advantage >= 0 & ratio <= 1 + settings$clip) |
    (advantage < 0 & ratio >= 1 - settings$clip)
  error <- of_value$outputs[1L, ] - batch$return
  gradient <- c(
    draws_gradient(
      policy, of_policy, -(advantage * ratio * counts) / n, -settings$entropy / n
    ),
    backward_network(of_value, matrix(2 * settings$value_weight / n * error, 1L))
  )
  # Compute means without mean(), which takes as long as a small product of matrices.
  policy_loss <- -sum(objective) / n
  value_loss <- sum(error * error) / n
  entropy_loss <- -sum(draws$entropy) / n
  list(gradient = gradient, log = c(
    approx_kl = sum(ratio - 1 - log_ratio) / n,
    clip_fraction = sum(abs(ratio - 1) > settings$clip) / n,
    entropy_loss = entropy_loss, policy_gradient_loss = policy_loss, value_loss = value_loss,
    loss = policy_loss + settings$entropy * entropy_loss + settings$value_weight * value_loss
  ))
}

#' @export
format.gym_agent_ppo <- function(x, ...) {
  agent_text("PPO", x[c("batch_steps", "batch", "epochs", "learning_rate", "gamma", "lambda",
                        "clip")])
}

#' @rdname agent_ppo
#' @export
learn_ppo <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_ppo", env, policy = policy, ...)
}
