# Returns of a random policy in CartPole-v0, from 321,312 episodes that a plain loop in
# Python played one after the other (Gymnasium 1.4): the mean, the standard deviation, and
# the shares of returns up to 12, 14, 19, 27 and 37.
known <- list(
  mean = 22.20, sd = 11.82, up_to = c(12, 14, 19, 27, 37),
  share = c(0.1564, 0.2760, 0.5330, 0.7664, 0.8999)
)

expect_known_returns <- function(returns) {
  n <- length(returns)
  expect_lt(abs(mean(returns) - known$mean), 3.5 * known$sd / sqrt(n))
  share <- vapply(known$up_to, function(up_to) mean(returns <= up_to), 0)
  expect_true(all(abs(share - known$share) < 3.5 * sqrt(known$share * (1 - known$share) / n)))
}

test_that("CartPole: returns in batches are distributed as those of one episode after the other", {
  skip_unless_all()
  client <- test_client()
  play <- function(env, episodes, seed) {
    rollout(env, policy_random(), episodes, seed = seed, client = client)$episodes$return
  }
  many <- play("CartPole-v0", 2000, 1)
  # As few as there are sub-environments, where favouring short episodes would show most.
  few <- unlist(lapply(1:8, function(seed) play("CartPole-v0", 250, seed)))
  apart <- play(
    local_env("CartPole-v0", num_envs = 16, vectorization_mode = "sync", client = client), 500, 1
  )
  alone <- play(local_env("CartPole-v0", client = client), 400, 1)
  for (returns in list(many, few, apart, alone)) {
    expect_known_returns(returns)
    # Ties make the p-value approximate.
    expect_gt(suppressWarnings(ks.test(returns, alone)$p.value), 0.01)
  }
})
