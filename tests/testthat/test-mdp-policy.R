# A model with terminal states, states that nothing leads to and actions that some states lack.
random_model <- function() {
  states <- sample(2:7, 1)
  actions <- sample(1:3, 1)
  left <- sort(sample(states, sample(states - 1L, 1))) - 1
  table <- expand.grid(action = seq_len(actions) - 1, state = left)
  has <- stats::runif(nrow(table)) < 0.8 | !duplicated(table$state)
  table <- table[has, ][rep(seq_len(sum(has)), each = 2), ]
  share <- stats::runif(nrow(table) / 2)
  table$probability <- as.vector(rbind(share, 1 - share))
  table$next_state <- sample(states, nrow(table), replace = TRUE) - 1
  table$reward <- sample(-2:3, nrow(table), replace = TRUE)
  table$terminated <- !table$next_state %in% left | stats::runif(nrow(table)) < 0.1
  gym_model(table)
}

# A policy of each kind for a model, with its probabilities: a few that draw in some states only.
random_policies <- function(model) {
  actions <- as.integer(model$action_space$n)
  can <- matrix(FALSE, length(model$start), actions)
  pairs <- model$transitions[c("state", "action")]
  can[cbind(match(pairs$state, names(model$start)), pairs$action + 1)] <- TRUE
  q <- ifelse(can, sample(9, length(can), replace = TRUE), -Inf)
  terminal <- rowSums(can) == 0
  by_row <- function(f) {
    p <- t(apply(q, 1, function(row) if (all(row == -Inf)) rep(0, actions) else f(row)))
    matrix(p, nrow(q), actions)
  }
  best <- by_row(function(row) seq_along(row) == which.max(row))
  uniform <- by_row(function(row) (row > -Inf) / sum(row > -Inf))
  soft <- function(temperature) {
    by_row(function(row) {
      weight <- exp((row - max(row)) / temperature)
      weight / sum(weight)
    })
  }
  some <- ifelse(stats::runif(nrow(q)) < 0.5, 1, 0)
  mixed <- some * uniform + (1 - some) * best
  list(
    list(policy = max.col(best, "first") - 1, p = best),
    list(policy = policy_table(q), p = best),
    list(policy = policy_random(), p = uniform),
    list(policy = policy_table(q, epsilon = 0.3), p = 0.3 * uniform + 0.7 * best),
    list(policy = policy_table(q, temperature = 2), p = soft(2)),
    # So cold that most probabilities round to 0, and equal values still share.
    list(policy = policy_table(q, temperature = 1e-3), p = soft(1e-3)),
    list(policy = mixed + terminal / actions, p = mixed)
  )
}

# The expected return and the expected number of steps, by the probabilities of moves from state to
# state, step after step.
plain_values <- function(model, p, limit, discount) {
  states <- length(model$start)
  moves <- matrix(0, states, states)
  rewards <- numeric(states)
  rows <- model$transitions
  for (i in seq_len(nrow(rows))) {
    from <- match(rows$state[[i]], names(model$start))
    to <- match(rows$next_state[[i]], names(model$start))
    taken <- rows$probability[[i]] * p[from, rows$action[[i]] + 1]
    rewards[[from]] <- rewards[[from]] + taken * rows$reward[[i]]
    if (!rows$terminated[[i]]) moves[from, to] <- moves[from, to] + taken
  }
  here <- model$start
  return <- length <- 0
  for (step in seq_len(limit)) {
    return <- return + discount^(step - 1) * sum(here * rewards)
    length <- length + sum(here[rowSums(p) > 0])
    here <- as.vector(here %*% moves)
  }
  c(return, length)
}

test_that("a policy's value is that of its moves, wherever it draws its actions", {
  set.seed(1)
  found <- plain <- list()
  for (i in seq_len(if (tests_all()) 500 else 50)) {
    model <- random_model()
    limit <- sample(c(1, 2, 5, 30), 1)
    discount <- sample(c(0.5, 0.9, 1), 1)
    policies <- sample(random_policies(model), 3)
    given <- lapply(policies, `[[`, "policy")
    exact <- evaluate_policy(model, given, max_steps = limit, discount = discount)
    found[[i]] <- rbind(exact$mean_return, exact$mean_length)
    plain[[i]] <- vapply(policies, function(one) {
      plain_values(model, one$p, limit, discount)
    }, c(0, 0))
  }
  expect_equal(found, plain, tolerance = 1e-10)
})

test_that("an evaluation in a training is exact where the policy draws in a few states", {
  # Softmax in two of four states, of which the others are the ends.
  trained <- train_agent(
    agent_actor_critic(), walk_model(max_episode_steps = 100), iterations = 1, seed = 1,
    evaluate = "draw"
  )
  p <- predict(trained$policy, 0:3, type = "probability")
  plain <- plain_values(walk_model(), p * c(0, 1, 1, 0), 100, 1)
  expect_equal(trained$final$mean_return, plain[[1L]], tolerance = 1e-10)
  random <- evaluate_policy(walk_model(max_episode_steps = 100), policy_random())
  expect_equal(c(random$mean_return, random$mean_length), c(1 / 3, 2))
})

test_that("an evaluation ends as soon as no value changes, in large models too", {
  n <- 600
  line <- data.frame(
    state = rep(seq_len(n), each = 2), action = 0:1, reward = -1,
    next_state = rep(seq_len(n), each = 2) + rep(c(-1, 1), n)
  )
  line$next_state[[1]] <- 1
  model <- gym_model(line, start = n - 5)
  # All sweeps would take hours.
  on.exit(setTimeLimit())
  setTimeLimit(elapsed = 60, transient = TRUE)
  right <- c(rep(1, n), 0)
  expect_identical(evaluate_policy(model, right, max_steps = 1e9)$mean_return, -6)
  setTimeLimit()
  # A solution with a horizon computes the values of all actions, sweep after sweep.
  policies <- list(right, rep(0:1, length.out = n + 1), policy_random())
  swept <- vapply(policies, function(policy) {
    solve_mdp(model, policy = policy, horizon = 50)$start_value
  }, 0)
  exact <- evaluate_policy(model, policies, max_steps = 50)$mean_return
  expect_equal(exact, swept, tolerance = 1e-12)
})
