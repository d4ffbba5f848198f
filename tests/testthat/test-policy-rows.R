fake_with <- function(observation_space, action_space) {
  vector_env_of(
    fake_vector_env(12, observation_space = observation_space, action_space = action_space)
  )
}

# Every candidate in three sub-environments.
candidates_in <- function(sub_envs, policy) {
  policies <- lapply(1:4, function(i) policy_bind(policy_resample(policy), sub_envs))
  list(policies = policies, together = candidates_of(policies, rep(1:4, each = 3)))
}

alone <- function(policies, observations, playing) {
  lapply(playing, function(i) act(policies[[(i + 2L) %/% 3L]], observations[i, ]))
}

test_that("candidates act together as each of them alone, in all sub-environments or in some", {
  set.seed(1)
  for (sizes in list(c(4, 1), c(4, 2, 1), c(4, 8, 8, 3), c(4, 1, 3))) {
    actions <- discrete_space(max(2L, sizes[[length(sizes)]]))
    sub_envs <- fake_with(box_space(rep(-1, 4), rep(1, 4)), actions)
    candidates <- candidates_in(sub_envs, policy_network(sizes))
    observations <- matrix(rnorm(48), ncol = 4)
    for (playing in list(1:12, c(2L, 3L, 7L, 12L), 5L)) {
      expect_identical(
        act_batch(candidates$together, observations[playing, , drop = FALSE], playing, sub_envs),
        unlist(alone(candidates$policies, observations, playing))
      )
    }
  }
})

test_that("so they do where actions are boxes, or observations discrete or arrays", {
  set.seed(2)
  sub_envs <- fake_with(box_space(rep(-1, 4), rep(1, 4)), box_space(c(-2, 0), c(2, 10)))
  candidates <- candidates_in(sub_envs, policy_network(c(4, 3, 2), c("tanh", "tanh")))
  observations <- matrix(rnorm(48), ncol = 4)
  expect_equal(
    act_batch(candidates$together, observations, 1:12, sub_envs),
    do.call(rbind, alone(candidates$policies, observations, 1:12)), tolerance = 1e-14
  )
  sub_envs <- fake_with(discrete_space(5L), discrete_space(2L))
  candidates <- candidates_in(sub_envs, policy_network(c(5, 2, 1)))
  observed <- sample(0:4, 12, replace = TRUE)
  expect_identical(
    act_batch(candidates$together, observed, 1:12, sub_envs),
    unlist(alone(candidates$policies, cbind(observed), 1:12))
  )
  sub_envs <- fake_with(box_space(rep(-1, 6), rep(1, 6), shape = c(2L, 3L)), discrete_space(2L))
  candidates <- candidates_in(sub_envs, policy_network(c(6, 2, 1)))
  arrays <- array(rnorm(72), c(12, 2, 3))
  one_by_one <- lapply(1:12, function(i) act(candidates$policies[[(i + 2) %/% 3]], arrays[i, , ]))
  expect_identical(act_batch(candidates$together, arrays, 1:12, sub_envs), unlist(one_by_one))
})

test_that("an infinite input spoils no other sub-environment's or neuron's sum", {
  sums <- sum_weighted(rbind(c(Inf, 1), c(2, 3)), rbind(c(1, -1, 1, 1), c(1, 2, 3, 4)))
  expect_identical(sums, rbind(c(Inf, -Inf), c(11, 16)))
})

test_that("a single candidate is played as the network that it is", {
  policy <- policy_network()
  expect_identical(candidates_of(list(policy), rep(1L, 5)), policy)
})
