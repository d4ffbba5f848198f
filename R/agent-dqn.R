#' Deep Q-networks
#'
#' Learn the value of each action with a network (Mnih et al. 2015). The agent plays
#' epsilon-greedily and keeps every step in a memory. It draws minibatches from the memory and moves
#' the values towards the reward plus the discounted value of the best next action. A target
#' network, an older copy, supplies that value. With `double = TRUE` the network itself chooses the
#' action (van Hasselt, Guez and Silver 2016).
#'
#' The policy is a [policy_network()] with the output `"epsilon-greedy"` and, by default, two hidden
#' layers of 64 ReLU neurons. Its `epsilon` is the agent's. The loss is Huber's. Its gradient is
#' clipped to `max_grad_norm` and passed to Adam (Kingma and Ba 2015).
#'
#' An iteration plays whole episodes, by default a single one, with the same `epsilon` and the same
#' weights. Then it makes `updates_per_step` updates per step. A remainder is carried over to the
#' next iteration. A truncated episode would have gone on, so the value of its last state counts.
#' After a terminated episode no reward can follow. If the policy has `normalize = TRUE`, the first
#' iteration plays random episodes, as in [agent_ppo()].
#'
#' @param memory The largest number of steps in the memory, a whole number. The oldest are
#'   forgotten. The default is 50,000.
#' @param learning_starts The number of steps before learning begins, a whole number. The default
#'   is 1000.
#' @param batch The number of steps in a minibatch, a whole number. The default is 64.
#' @param updates_per_step The number of minibatches per step, a number above 0. The default is 0.5.
#' @param learning_rate The step size of Adam, a number above 0, or a function of the steps so far.
#'   The default is 1e-3.
#' @param gamma The discount, a number from 0 to 1. The default is 0.99.
#' @param epsilon The probability of a random action, a number from 0 to 1, or a function of the
#'   steps so far. The default goes from 1 to 0.05 in 10,000 steps.
#' @param double Does the network choose the action that the target network values? `TRUE`, the
#'   default, or `FALSE` as in Mnih et al. (2015).
#' @param target_every The number of steps after which the target network becomes a copy of the
#'   network, a whole number. The default is 500. The updates of an iteration count as if they were
#'   spread evenly over its steps.
#' @param target_rate `NULL`, the default, or a number from 0 to 1. The target network then moves by
#'   this share towards the network in each update, and `target_every` is ignored.
#' @param max_grad_norm The largest length of a gradient, a number or `Inf`. The default is 10.
#' @param batch_steps The approximate number of steps in an iteration, a whole number. The default
#'   is 1.
#' @param min_episodes The smallest number of episodes in an iteration. The default is 1.
#' @inheritParams agent_ars
#' @param policy The policy. `NULL`, the default, uses the preset's policy, or the one described in
#'   the details.
#' @return `agent_dqn()` returns an agent of class `gym_agent_dqn`. `learn_dqn()` makes this agent,
#'   trains it and returns the result of [train_agent()]. For each iteration its history and the log
#'   have `loss`, `n_updates`, `exploration_rate` and `learning_rate`.
#' @section Errors: As for [agent_ppo()], and `gym_error_argument` for actions that are not
#'   Discrete.
#' @references V. Mnih et al. (2015), Human-level control through deep reinforcement learning,
#'   Nature 518.
#'
#'   H. van Hasselt, A. Guez and D. Silver (2016), Deep reinforcement learning with double
#'   Q-learning, AAAI.
#' @seealso [agent_ppo()]
#' @export
#' @examples
#' agent_dqn()
#' @examplesIf gym:::can_start_server()
#' learn_dqn("CartPole-v1", total_steps = 1500, seed = 1)
agent_dqn <- function(memory = 50000, learning_starts = 1000, batch = 64, updates_per_step = 0.5,
                      learning_rate = 1e-3, gamma = 0.99,
                      epsilon = schedule_linear(1, 0.05, 10000), double = TRUE,
                      target_every = 500, target_rate = NULL, max_grad_norm = 10,
                      batch_steps = 1, min_episodes = 1) {
  settings <- mget(names(formals()))
  check_count(memory)
  check_count(learning_starts, min = 0)
  check_count(batch, max = memory)
  check_above_zero(updates_per_step)
  check_schedules(settings, "learning_rate")
  check_number(gamma, min = 0, max = 1)
  check_schedules(settings, "epsilon", max = 1)
  check_flag(double)
  check_count(target_every)
  check_number(target_rate, min = 0, max = 1, allow_null = TRUE)
  check_number(max_grad_norm, min = 0)
  check_count(batch_steps)
  check_count(min_episodes)
  names(settings)[[1L]] <- "memory_size"
  new_gradient_agent("dqn", c(settings, list(carried = 0)), dqn_log)
}

dqn_log <- c("loss", "n_updates", "exploration_rate", "learning_rate")

#' @export
agent_start.gym_agent_dqn <- function(agent, policy) {
  agent <- NextMethod()
  space <- policy$action_space
  abort_if(
    !inherits(space, "gym_space_discrete"), "env", NULL, NULL,
    "DQN learns a value for each action of a Discrete space, but the actions of
     {env_text(policy)} are of {format(space)}.",
    i = "Use `agent_ppo()` for these actions."
  )
  abort_if(
    !identical(policy$output, "epsilon-greedy") || utils::tail(policy$sizes, 1L) != space$n,
    "policy", policy, NULL,
    'DQN needs a network with a value for each of {count_of(space$n, "action")} and the output
     "epsilon-greedy", not {format(policy)}.',
    i = '`policy_network(c(NA, 64, 64, NA), output = "epsilon-greedy")` is one.'
  )
  agent$target <- weight_vector(policy)
  agent$adam <- new_adam(count_weights(policy))
  agent$updates <- agent$carried <- 0
  agent$memory <- new_memory(agent$memory_size)
  agent
}

#' @exportS3Method
default_policy.gym_agent_dqn <- function(agent) {
  policy_network(
    c(NA, 64, 64, NA), c("ReLU", "identity"), bias = TRUE, output = "epsilon-greedy",
    init = "orthogonal"
  )
}

#' @export
agent_behavior.gym_agent_dqn <- function(agent) {
  behavior <- NextMethod()
  if (!is_warming_up(agent)) behavior$epsilon <- epsilon_now(agent)
  behavior
}

epsilon_now <- function(agent) scheduled(agent$epsilon, agent$steps, "epsilon")

#' @export
agent_tell.gym_agent_dqn <- function(agent, results) {
  now <- scheduled_settings(agent, "learning_rate")
  agent$log[c("exploration_rate", "learning_rate")] <- c(epsilon_now(agent), now$learning_rate)
  steps <- length(results$trajectories$reward)
  # Take the memory out of the agent, so that R can write into it without copying it.
  memory <- agent$memory
  agent$memory <- NULL
  memory <- add_to_memory(memory, remembered(agent$policy, results$trajectories))
  if (!is_warming_up(agent) && memory$count >= agent$learning_starts) {
    due <- agent$carried + steps * agent$updates_per_step
    agent$carried <- due - floor(due)
    agent <- learn_from_memory(agent, memory, floor(due), steps, now)
  }
  agent$memory <- memory
  end_iteration(agent, results)
}

learn_from_memory <- function(agent, memory, updates, steps, settings) {
  policy <- agent$policy
  state <- list(weights = weight_vector(policy), target = agent$target, adam = agent$adam)
  kept <- min(memory$count, agent$memory_size)
  # The step at which each update takes place, and whether the update renews the target network.
  at <- agent$steps + steps * seq_len(updates) / max(updates, 1)
  period <- floor(c(agent$steps, at) / agent$target_every)
  renews <- is.null(agent$target_rate) & diff(period) > 0
  drawn <- matrix(sample.int(kept, agent$batch * updates, replace = TRUE), agent$batch)
  losses <- numeric(updates)
  for (update in seq_len(updates)) {
    rows <- recalled(memory, policy, drawn[, update])
    state <- dqn_update(policy, state, rows, settings)
    losses[[update]] <- state$loss
    if (renews[[update]]) {
      state$target <- state$weights
    } else if (!is.null(agent$target_rate)) {
      state$target <- state$target + agent$target_rate * (state$weights - state$target)
    }
  }
  check_finite_weights(state$weights, agent)
  agent$policy <- with_weights(policy, state$weights)
  agent[c("target", "adam")] <- state[c("target", "adam")]
  agent$updates <- agent$updates + updates
  agent$log[c("loss", "n_updates")] <- c(if (updates) mean(losses) else NA_real_, agent$updates)
  agent
}

#' Follow the gradient of a minibatch
#' @param policy The network. Its own weights are ignored.
#' @param state A list: `weights`, `target`, the weights of the target network, and `adam`.
#' @param rows The steps: `inputs` and `next_inputs`, matrices with an observation in each column,
#'   `action`, numbers from 1, `reward` and `terminated`.
#' @param settings The arguments of agent_dqn(), without schedules.
#' @return The list with new `weights` and `adam`, and the `loss` before.
#' @noRd
dqn_update <- function(policy, state, rows, settings) {
  n <- length(rows$reward)
  values_after <- forward_network(layers_of(policy, state$target), rows$next_inputs)$outputs
  layers <- layers_of(policy, state$weights)
  best <- if (settings$double) {
    own <- forward_network(layers, rows$next_inputs)$outputs
    values_after[places_of_actions(nrow(own), max.col(t(own), "first"))]
  } else {
    column_max(values_after)
  }
  best[rows$terminated] <- 0
  wanted <- rows$reward + settings$gamma * best

  forward <- forward_network(layers, rows$inputs)
  outputs <- forward$outputs
  taken <- places_of_actions(nrow(outputs), rows$action)
  error <- outputs[taken] - wanted
  # The slope of Huber's loss: that of the squared error up to an error of 1, and constant beyond
  # it.
  slopes <- matrix(0, nrow(outputs), n)
  slopes[taken] <- pmax.int(-1, pmin.int(error, 1)) / n
  gradient <- clip_norm(backward_network(forward, slopes), settings$max_grad_norm)
  moved <- adam_step(state$weights, gradient, state$adam, settings$learning_rate)
  size <- abs(error)
  state[c("weights", "adam")] <- moved
  state$loss <- mean(ifelse(size < 1, error * error / 2, size - 0.5))
  state
}

# The memory ---------------------------------------------------------------------------------

# Makes an empty memory: `size` is the largest number of steps, beyond which the oldest are
# overwritten; `count` is the number of all steps so far; `steps` is a matrix with a step in each
# column.
new_memory <- function(size) {
  structure(list(size = size, count = 0, steps = NULL), class = "gym_memory")
}

# Adds a matrix with a step in each column.
add_to_memory <- function(memory, new) {
  n <- ncol(new)
  # If there are more steps than fit, keep the last ones.
  kept <- seq.int(max(1, n - memory$size + 1), n)
  at <- (memory$count + kept - 1) %% memory$size + 1
  room <- max(0L, ncol(memory$steps))
  if (max(at) > room) {
    grown <- matrix(0, nrow(new), min(memory$size, max(2 * room, at, 1024)))
    if (room) grown[, seq_len(room)] <- memory$steps
    memory$steps <- grown
  }
  memory$steps[, at] <- new[, kept]
  memory$count <- memory$count + n
  memory
}

# Makes columns of the memory: the observation, the next observation, the action, the reward, and
# whether the episode terminated.
remembered <- function(policy, trajectories) {
  rbind(
    t(number_rows(trajectories$observation)), t(number_rows(trajectories$next_observation)),
    network_actions(policy, trajectories$action), trajectories$reward, trajectories$terminated
  )
}

recalled <- function(memory, policy, at) {
  steps <- memory$steps[, at, drop = FALSE]
  width <- (nrow(steps) - 3L) %/% 2L
  own <- seq_len(width)
  seen <- function(rows) t(network_inputs(policy, t(steps[rows, , drop = FALSE])))
  list(
    inputs = seen(own), next_inputs = seen(width + own),
    action = as.integer(steps[2L * width + 1L, ]), reward = steps[2L * width + 2L, ],
    terminated = steps[2L * width + 3L, ] == 1
  )
}

#' @export
format.gym_agent_dqn <- function(x, ...) {
  agent_text(if (x$double) "Double DQN" else "DQN", c(memory = x$memory_size, x[c(
    "batch", "updates_per_step", "learning_rate", "gamma", "epsilon"
  )]))
}

#' @rdname agent_dqn
#' @export
learn_dqn <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_dqn", env, policy = policy, ...)
}
