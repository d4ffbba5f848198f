# The updates of agents that follow gradients, against those that tools/learn/updates.py has stored:
# of Stable-Baselines3's own code and of an implementation in NumPy, given the same numbers.

stored_updates <- function(agent) jsonlite::fromJSON(test_path("gradient_updates.json"))[[agent]]

# Rows of weights, an update in each.
expect_same_updates <- function(weights, case) {
  expect_lt(max(abs(weights - case$numpy)), 1e-10)
  if (!is.null(case$sb3)) expect_lt(max(abs(weights - case$sb3)), 1e-8)
}

ppo_rows <- function(case) {
  list(
    inputs = t(case$observation),
    action = if (is.matrix(case$action)) t(case$action) else case$action + 1L,
    log_prob = case$log_prob, advantage = case$advantage, return = case$return
  )
}

ppo_of <- function(case) {
  output <- if (is.matrix(case$action)) "gaussian" else "softmax"
  agent <- agent_ppo(
    learning_rate = case$learning_rate, clip = case$clip, entropy = case$entropy,
    value_weight = case$value_weight, max_grad_norm = case$max_grad_norm
  )
  policy <- policy_network(case$sizes, bias = TRUE, output = output)
  value <- policy_network(case$value_sizes, c("tanh", "identity"), bias = TRUE)
  rows <- ppo_rows(case)
  function(weights, adam, epochs) ppo_update(policy, value, weights, adam, rows, epochs, agent)
}

test_that("ten updates of PPO are those of Stable-Baselines3 and of NumPy", {
  for (case in stored_updates("ppo")) {
    update <- ppo_of(case)
    learned <- list(weights = case$start, adam = new_adam(length(case$start)))
    weights <- apply(case$order + 1L, 1L, function(at) {
      learned <<- update(learned$weights, learned$adam, list(list(at)))
      learned$weights
    })
    expect_same_updates(t(weights), case)
  }
})

test_that("what PPO logs are the numbers of Stable-Baselines3", {
  for (case in stored_updates("ppo")) {
    at <- asplit(case$order + 1L, 1L)
    epochs <- split(at, rep(1:5, each = 2L))
    log <- ppo_of(case)(case$start, new_adam(length(case$start)), epochs)$log
    # That of the fraction is counted in single precision.
    expect_equal(log[names(case$log)], unlist(case$log), tolerance = 1e-7)
  }
})

test_that("ten updates of DQN are those of Stable-Baselines3 and of NumPy, the target's too", {
  seeds <- c(hard = 3, soft = 4, double = 5)
  cases <- stored_updates("dqn")
  env <- fake_environment(action_space = discrete_space(3))
  for (name in names(cases)) {
    case <- cases[[name]]
    soft <- case$target_every == 1L
    agent <- agent_dqn(
      memory = 40, batch = ncol(case$order), learning_rate = case$learning_rate,
      gamma = case$discount, double = case$double, target_every = case$target_every,
      target_rate = if (soft) case$tau, max_grad_norm = case$max_grad_norm
    )
    policy <- policy_network(
      case$sizes, c("ReLU", "identity"), bias = TRUE, output = "epsilon-greedy"
    )
    coef(policy) <- case$start
    agent <- agent_start(agent, policy_bind(policy, env))
    memory <- add_to_memory(new_memory(40), remembered(agent$policy, list(
      observation = case$observation, next_observation = case$next_observation,
      action = case$action, reward = case$reward, terminated = case$terminated
    )))
    set.seed(seeds[[name]])
    weights <- vapply(0:9, function(steps) {
      agent$steps <<- steps
      agent <<- learn_from_memory(agent, memory, 1, 1, agent)
      coef(agent$policy)
    }, case$start)
    expect_same_updates(t(weights), case)
  }
})
