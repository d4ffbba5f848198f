# Shared by the agents that follow gradients: the number of episodes per iteration, the first
# moments of observations, and the steps of an iteration as rows.

new_gradient_agent <- function(class, settings, log) {
  settings <- c(settings, list(
    log = rlang::rep_named(log, NA_real_), policy = NULL, iteration = 0L, steps = 0,
    episodes = settings$min_episodes
  ))
  new_agent(class, settings, "gym_agent_gradient")
}

#' @export
agent_start.gym_agent_gradient <- function(agent, policy) {
  space <- policy$observation_space
  abort_if(
    length(space$shape) > 1L, "env", NULL, NULL,
    "Agents that follow gradients need observations that are vectors, but those of
     {env_text(policy)} are of {format(space)}.",
    i = if (startsWith(policy$env_id %||% "", "ALE/")) {
      '`obs_type = "ram"` observes the 128 numbers of the memory: `learn_ppo("{policy$env_id}",
       obs_type = "ram", total_steps = 1e6)`.'
    },
    i = if (length(space$shape) == 3L) {
      '`env <- gym_wrap(gym_wrap(env, "GrayscaleObservation"), "ResizeObservation",
       shape = c(32, 32))` makes small grey pictures.'
    },
    i = '`gym_wrap(env, "FlattenObservation")` makes vectors, from which the agent can learn.'
  )
  agent <- NextMethod()
  agent$iteration <- 0L
  agent$steps <- 0
  agent$episodes <- agent$min_episodes
  if (is_warming_up(agent)) agent$episodes <- max(agent$min_episodes, warm_up_episodes)
  agent
}

#' @export
agent_needs.gym_agent_gradient <- function(agent) c("returns", "trajectories")

# The policy is played as it is.
#' @export
agent_ask.gym_agent_gradient <- function(agent) NULL

#' @export
agent_episodes.gym_agent_gradient <- function(agent, episodes) agent$episodes

#' @exportS3Method
default_policy.gym_agent_gradient <- function(agent) {
  policy_network(c(NA, 64, 64, NA), bias = TRUE, output = NA, init = "orthogonal")
}

# Observations are normalised from the first step of learning, so their moments come from random
# episodes. Moments that came later would suddenly change the policy.
warm_up_episodes <- 8L

is_warming_up <- function(agent) identical(agent$policy$moments$count, 0)

#' @export
agent_behavior.gym_agent_gradient <- function(agent) {
  if (is_warming_up(agent)) {
    policy_bind(policy_random(), agent$policy[c("observation_space", "action_space")])
  } else {
    agent$policy
  }
}

#' Put the steps of an iteration into rows
#' @return A list: `inputs` and `last_inputs`, matrices with an observation in each column, prepared
#'   for the network, of each step and of the observations after the last step of each episode;
#'   `observations` as they were returned; `action`, the numbers of actions from 1, or a matrix with
#'   an action in each column; `reward`, `terminated`; `last`, whether a step is the last of its
#'   episode.
#' @noRd
iteration_rows <- function(policy, trajectories) {
  last <- ends_of(trajectories$episode)
  observations <- number_rows(trajectories$observation)
  after <- number_rows(trajectories$next_observation)
  list(
    inputs = t(network_inputs(policy, observations)),
    last_inputs = t(network_inputs(policy, after[last, , drop = FALSE])),
    observations = observations, action = network_actions(policy, trajectories$action),
    reward = trajectories$reward, terminated = trajectories$terminated, last = last
  )
}

network_actions <- function(policy, action) {
  space <- policy$action_space
  if (inherits(space, "gym_space_discrete")) {
    as.integer(action) - as.integer(space$start) + 1L
  } else {
    matrix(row_major(action), prod(space$shape))
  }
}

#' End an iteration: count steps, update the moments of observations, choose the number of episodes
#'
#' The number of episodes is fixed before they are played. An iteration that stops at a number of
#' steps would contain too many short episodes.
#' @noRd
end_iteration <- function(agent, results) {
  trajectories <- results$trajectories
  agent$iteration <- agent$iteration + 1L
  agent$steps <- agent$steps + length(trajectories$reward)
  if (!is.null(agent$policy$moments)) {
    seen <- moments_of(number_rows(trajectories$observation))
    agent$policy$moments <- merge_moments(agent$policy$moments, seen)
  }
  played <- trajectories$episode[[length(trajectories$episode)]]
  wanted <- round(agent$batch_steps / (length(trajectories$reward) / played))
  agent$episodes <- as.integer(max(agent$min_episodes, min(wanted, 4 * played)))
  agent
}

# If the weights are not finite, training ends with an error whose result has the last finite ones.
check_finite_weights <- function(weights, agent) {
  if (!all(is.finite(weights))) {
    gym_abort(
      c(paste0("The weights became NaN or infinite in iteration ", agent$iteration + 1L, "."),
        i = "A smaller `learning_rate` or normalized observations may help."),
      class = "gym_error_agent", iteration = agent$iteration + 1L, call = NULL
    )
  }
}

# A value network with the hidden layers of a policy.
value_network <- function(policy) {
  sizes <- policy$sizes
  sizes[[length(sizes)]] <- 1L
  activation <- policy$activation
  activation[[length(activation)]] <- "identity"
  value <- new_network(sizes, activation, policy$bias, normalize = FALSE)
  value$init <- policy$init
  value$observation_space <- policy$observation_space
  value$weights <- draw_first_weights(value)
  value
}

expected_values <- function(value, inputs) {
  forward_network(layers_of(value), inputs)$outputs[1L, ]
}

#' Cut rows into minibatches of nearly equal size, in a random order
#' @return A list of vectors of row numbers.
#' @noRd
draw_minibatches <- function(n, batch) {
  count <- max(1, round(n / batch))
  order <- sample.int(n)
  ends <- (0:count * as.numeric(n)) %/% count
  lapply(seq_len(count), function(i) order[(ends[[i]] + 1):ends[[i + 1L]]])
}

#' @export
agent_log.gym_agent_gradient <- function(agent) agent$log

# The settings at the current number of steps, with schedules evaluated.
scheduled_settings <- function(agent, names) {
  for (name in names) agent[[name]] <- scheduled(agent[[name]], agent$steps, name, max = Inf)
  agent
}

# An agent that follows the gradient of log-probabilities needs a policy with probabilities.
check_has_log_prob <- function(policy, name) {
  if (!has_log_prob(policy)) {
    box <- inherits(policy$action_space, "gym_space_box")
    abort_wrong(
      "policy", policy, NULL,
      '{name} needs a policy that draws its actions{if (box) ", with standard deviations"}, not
       {format(policy)}.',
      i = 'Make it with `output = "{if (box) "gaussian" else "softmax"}"`.'
    )
  }
}

# Returns and advantages ---------------------------------------------------------------

# Returns and advantages of whole episodes, whose steps are in order.

#' Sum the values from each step to the end of its episode
#' @param values The value of each step.
#' @param decay The discount per step.
#' @param last Whether a step is the last of its episode. By default all steps are of one episode.
#' @noRd
sum_backwards <- function(values, decay, last = seq_along(values) == length(values)) {
  sum <- 0
  for (t in rev(seq_along(values))) {
    sum <- values[[t]] + if (last[[t]]) 0 else decay * sum
    values[[t]] <- sum
  }
  values
}

# Whether each step is the last of its episode, given the episodes' numbers.
ends_of <- function(episode) c(episode[-1L] != episode[-length(episode)], TRUE)

# The value of the state after each step. It is 0 if the episode terminated. A truncated episode
# would have gone on, so its last state keeps its value.
next_values <- function(value, last_value, terminated, last) {
  after <- c(value[-1L], 0)
  after[last] <- last_value
  after[terminated] <- 0
  after
}

# Divides rewards by the standard deviation of the discounted return so far and clips them at 10.
# Returns a list: `reward`, and the `moments` of that return.
scale_rewards <- function(reward, last, gamma, moments) {
  so_far <- reward
  for (t in seq_along(reward)[-1L]) {
    if (!last[[t - 1L]]) so_far[[t]] <- reward[[t]] + gamma * so_far[[t - 1L]]
  }
  moments <- merge_moments(moments, moments_of(matrix(so_far)))
  deviation <- sqrt(moments$squares / moments$count)
  list(reward = pmax(-10, pmin(reward / max(deviation, 1e-4), 10)), moments = moments)
}

# A single advantage has no standard deviation. If its mean were subtracted, it would be 0 and
# change nothing. So it stays as it is, as in Stable-Baselines3.
standardized <- function(x) {
  n <- length(x)
  if (n < 2L) {
    return(x)
  }
  deviation <- x - sum(x) / n
  deviation / (sqrt(sum(deviation * deviation) / (n - 1)) + 1e-8)
}

explained_variance <- function(value, return) {
  spread <- stats::var(return)
  if (isTRUE(spread > 0)) 1 - stats::var(return - value) / spread else NA_real_
}

# Adam ---------------------------------------------------------------------------------

# Adam (Kingma and Ba 2015, Algorithm 1), and gradient clipping.

new_adam <- function(count) list(mean = numeric(count), square = numeric(count), steps = 0)

#' Take a step down a gradient
#' @param weights,gradient Vectors of the same length.
#' @param adam The moments so far, as returned by new_adam() or by this function.
#' @param epsilon Keeps the divisor away from 0.
#' @return A list: `weights` and `adam`.
#' @noRd
adam_step <- function(weights, gradient, adam, learning_rate, epsilon = 1e-8) {
  # Each operation on all weights takes some percent of the time of an update, so use few. This mean
  # is 0.9 * mean + 0.1 * gradient.
  steps <- adam$steps + 1
  mean <- adam$mean + 0.1 * (gradient - adam$mean)
  square <- adam$square + 0.001 * (gradient * gradient - adam$square)
  size <- learning_rate / (1 - 0.9^steps)
  weights <- weights - size * (mean / (sqrt(square) * (1 / sqrt(1 - 0.999^steps)) + epsilon))
  list(weights = weights, adam = list(mean = mean, square = square, steps = steps))
}

# Shortens a gradient to the length `longest` if it is longer.
clip_norm <- function(gradient, longest) {
  norm <- sqrt((gradient %*% gradient)[[1L]])
  if (isTRUE(norm > longest)) gradient * (longest / (norm + 1e-6)) else gradient
}
