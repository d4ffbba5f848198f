test_that("advantages are those of the definition, over episodes that end in either way", {
  set.seed(1)
  lengths <- c(4, 1, 6)
  episode <- rep(1:3, lengths)
  last <- c(diff(episode) == 1, TRUE)
  terminated <- last & episode != 3
  reward <- rnorm(11)
  value <- rnorm(11)
  last_value <- rnorm(3)
  gamma <- 0.9
  lambda <- 0.7
  after <- next_values(value, last_value, terminated, last)
  found <- estimate_advantages(reward, value, after, last, gamma, lambda)
  # Schulman et al. (2016), equation 16: the sum of (gamma lambda)^l delta, to the episode's end.
  for (own in split(seq_along(reward), episode)) {
    n <- length(own)
    end <- if (terminated[own[n]]) 0 else last_value[episode[own[1]]]
    delta <- reward[own] + gamma * c(value[own][-1], end) - value[own]
    wanted <- vapply(seq_len(n), function(t) {
      sum((gamma * lambda)^(0:(n - t)) * delta[t:n])
    }, 0)
    expect_equal(found[own], wanted)
  }
})

test_that("rewards are divided by the deviation of the discounted return so far, and cut at 10", {
  reward <- c(1, 2, 3, -4)
  last <- c(FALSE, TRUE, FALSE, TRUE)
  first <- scale_rewards(reward, last, 0.5, NULL)
  returns <- c(1, 2.5, 3, -2.5)
  deviation <- sqrt(mean((returns - mean(returns))^2))
  expect_equal(first$reward, reward / deviation)
  second <- scale_rewards(reward * 1000, last, 0.5, first$moments)
  expect_equal(second$moments$count, 8)
  rare <- scale_rewards(c(rep(0, 999), 1e6), c(rep(FALSE, 999), TRUE), 0.5, NULL)
  expect_identical(max(rare$reward), 10)
})

test_that("a single advantage stays as it is, so that it teaches", {
  expect_identical(standardized(-3), -3)
  expect_equal(standardized(c(1, 2, 6)), (c(1, 2, 6) - 3) / (sd(c(1, 2, 6)) + 1e-8))
  env <- gym_env(
    function(self) 0,
    function(self, action) list(observation = 0, reward = action, terminated = TRUE),
    space_box(-1, 1, 1), space_discrete(2)
  )
  policy <- policy_network(c(NA, NA), "identity", bias = TRUE, output = NA, init = "orthogonal")
  learned <- function(agent) {
    trained <- suppressMessages(train_agent(
      agent, env, policy, total_steps = 200, seed = 1, eval_episodes = 2, eval_episodes_curve = 0,
      target = Inf
    ))
    trained$final$mean_return
  }
  expect_identical(learned(agent_ppo(20, batch = 1, learning_rate = 0.01)), 1)
  expect_identical(learned(agent_reinforce(1, baseline = FALSE, min_episodes = 1)), 1)
})
