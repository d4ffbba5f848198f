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
