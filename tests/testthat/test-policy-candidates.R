test_that("candidates give back their weights, with their names", {
  weights <- rbind(left = c(0, 0, -1, 0), right = c(0, 0, 1, 0))
  candidates <- policy_candidates(policy_network(c(4, 1)), weights)
  expect_identical(coef(candidates), weights)
  coef(candidates) <- -weights
  expect_identical(coef(candidates), -weights)
  expect_identical(
    format(candidates), "2 candidates of network 4-1, logistic, 4 weights"
  )
  whole <- policy_candidates(policy_network(c(4, 1)), matrix(1:4, 1))
  expect_identical(coef(whole), matrix(as.numeric(1:4), 1))
})

test_that("a matrix of the wrong width is refused with the width that is right", {
  policy <- policy_network(c(4, 2, 1))
  try_weights <- function(weights) policy_candidates(policy, weights)
  cnd <- expect_error(
    try_weights(matrix(0, 3, 9)),
    "`weights` must have the 10 weights of a candidate in each row, one a column, not 9 columns.",
    fixed = TRUE, class = "gym_error_argument"
  )
  expect_null(cnd$body)
  cnd <- expect_error(try_weights(matrix(0, 10, 3)), "not 3 columns", class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "`t(weights)` has a candidate in each row.", fixed = TRUE)
})

test_that("what is no matrix of numbers is refused", {
  policy <- policy_network(c(4, 1))
  try_weights <- function(weights) policy_candidates(policy, weights)
  cnd <- expect_error(try_weights(1:4), "a numeric matrix with a candidate in each row",
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "`rbind(weights)`", fixed = TRUE)
  expect_error(try_weights(matrix("a", 1, 4)), "a numeric matrix", class = "gym_error_argument")
  expect_error(try_weights(data.frame(a = 1)), "a data frame with 1 row",
               class = "gym_error_argument")
  expect_error(try_weights(matrix(0, 0, 4)), "an array of 0 x 4", class = "gym_error_argument")
  expect_error(try_weights(matrix(c(1, 2, 3, NA), 1)), "without missing values",
               class = "gym_error_argument")
  expect_error(policy_candidates(policy_random(), matrix(0, 1, 4)), "a policy with weights",
               class = "gym_error_argument")
})
fake_spaces <- function(observation_space, action_space) {
  list(
    observation_space = observation_space, action_space = action_space, spec = list(id = "Fake-v0")
  )
}

four <- box_space(rep(-1, 4), rep(1, 4))

# Four candidates, and each of them alone.
candidates_in <- function(env, policy) {
  together <- policy_candidates(policy, matrix(runif(4 * length(coef(policy)), -1, 1), 4))
  alone <- lapply(1:4, function(i) {
    coef(policy) <- coef(together)[i, ]
    policy_bind(policy, env)
  })
  list(together = policy_bind(together, env), alone = alone)
}

act_of_rows <- function(policy, observations, candidate, env) {
  act_batch(policy_rows(policy, candidate), observations, length(candidate), env)
}

test_that("candidates act together as each of them alone, whichever play", {
  set.seed(1)
  for (sizes in list(c(4, 1), c(4, 2, 1), c(4, 8, 8, 3), c(4, 1, 3))) {
    env <- fake_spaces(four, discrete_space(max(2L, sizes[[length(sizes)]])))
    policies <- candidates_in(env, policy_network(sizes))
    observations <- matrix(rnorm(48), ncol = 4)
    for (candidate in list(rep(1:4, each = 3), rep(1:4, 3), c(1L, 1L, 3L, 4L), 2L)) {
      seen <- observations[seq_along(candidate), , drop = FALSE]
      expect_identical(
        act_of_rows(policies$together, seen, candidate, env),
        vapply(seq_along(candidate), function(i) act(policies$alone[[candidate[i]]], seen[i, ]), 0L)
      )
    }
  }
})

test_that("so they do where actions are boxes, or observations discrete or arrays", {
  set.seed(2)
  candidate <- rep(1:4, each = 3)
  env <- fake_spaces(four, box_space(c(-2, 0), c(2, 10)))
  policies <- candidates_in(env, policy_network(c(4, 3, 2), c("tanh", "tanh")))
  observations <- matrix(rnorm(48), ncol = 4)
  each <- lapply(1:12, function(i) act(policies$alone[[candidate[i]]], observations[i, ]))
  expect_equal(act_of_rows(policies$together, observations, candidate, env),
               do.call(rbind, each), tolerance = 1e-14)

  env <- fake_spaces(discrete_space(5L), discrete_space(2L))
  policies <- candidates_in(env, policy_network(c(5, 2, 1)))
  observed <- sample(0:4, 12, replace = TRUE)
  expect_identical(
    act_of_rows(policies$together, observed, candidate, env),
    vapply(1:12, function(i) act(policies$alone[[candidate[i]]], observed[i]), 0L)
  )

  env <- fake_spaces(box_space(rep(-1, 6), rep(1, 6), shape = c(2L, 3L)), discrete_space(2L))
  policies <- candidates_in(env, policy_network(c(6, 2, 1)))
  arrays <- array(rnorm(72), c(12, 2, 3))
  expect_identical(
    act_of_rows(policies$together, arrays, candidate, env),
    vapply(1:12, function(i) act(policies$alone[[candidate[i]]], arrays[i, , ]), 0L)
  )
})

test_that("an infinite input spoils no other row's or neuron's sum", {
  sums <- sum_weighted(rbind(c(Inf, 1), c(2, 3)), rbind(c(1, -1, 1, 1), c(1, 2, 3, 4)))
  expect_identical(sums, rbind(c(Inf, -Inf), c(11, 16)))
})

test_that("some of the candidates are these alone, and one of them is the policy itself", {
  policy <- policy_network(c(4, 1))
  weights <- matrix(runif(12), 3)
  candidates <- policy_candidates(policy, weights)
  expect_identical(coef(policy_subset(candidates, 2:3)), weights[2:3, ])
  coef(policy) <- weights[2, ]
  expect_identical(policy_subset(candidates, 2L), policy)
  follow <- function(observation) 1L
  policies <- policy_list(list(policy, follow, policy_random()))
  expect_identical(policy_subset(policies, 2L), follow)
  expect_identical(policy_subset(policies, c(1L, 3L)), policy_list(list(policy, policy_random())))
  expect_identical(policy_subset(follow, 1L), follow)
})

# An action of each kind of space for each observation, made of its first number.
kinds_of_actions <- function() {
  text <- list(name = "Text", min_length = 1L, max_length = 6L, characters = "abc")
  move <- list(name = "Discrete", n = 90L, start = 0L, dtype = "int64")
  first <- function(o) as.integer(o[, 1])
  numbers <- function(o) cbind(first(o), first(o) + 0.5)
  list(
    list(space = new_space(move), act = first),
    list(space = box_space(0, 99), act = function(o) cbind(as.numeric(first(o)))),
    list(space = box_space(c(0, 0), c(99, 99)), act = numbers),
    list(space = box_space(rep(0, 4), rep(99, 4), shape = c(2L, 2L)),
         act = function(o) array(cbind(numbers(o), -numbers(o)), c(nrow(o), 2, 2))),
    list(space = new_space(text), act = function(o) strrep("a", first(o) %% 5 + 1)),
    list(space = new_space(list(name = "Tuple", spaces = list(move, text))),
         act = function(o) list(first(o), strrep("b", first(o) %% 5 + 1))),
    list(space = new_space(describe_dict(speed = describe_box(0, 99), move = move)),
         act = function(o) list(move = first(o), speed = cbind(as.numeric(first(o))))),
    list(space = new_space(list(name = "Sequence", space = move, stack = FALSE)),
         act = function(o) lapply(first(o), function(i) as.list(seq_len(i %% 3))))
  )
}

test_that("the policies of a list act each for its own rows, whatever the actions are", {
  observations <- matrix(11:28, 6)
  candidate <- c(2L, 1L, 3L, 1L, 2L, 1L)
  for (kind in kinds_of_actions()) {
    env <- fake_spaces(box_space(rep(0, 3), rep(99, 3)), kind$space)
    env$call <- quote(test())
    asked <- list()
    policies <- lapply(1:3, function(i) {
      function(observation) {
        asked[[i]] <<- observation[, 1]
        kind$act(observation)
      }
    })
    policies <- policy_bind(policy_list(policies), env)
    together <- act_of_rows(policies, observations, candidate, env)
    expected <- bind_batches(kind$space, list(kind$act(observations)))
    expect_identical(together, expected)
    expect_identical(asked, list(c(12L, 14L, 16L), c(11L, 15L), 13L))
  }
})

test_that("a list may have policies of every kind", {
  skip_if_not_installed("rpart")
  steps <- data.frame(pole_angle = -9:9, action = rep(0:1, c(9, 10)))
  tree <- rpart::rpart(factor(action) ~ pole_angle, steps, minsplit = 5)
  network <- policy_network(c(4, 1), weights = list(matrix(c(0, 0, 1, 0), 1)))
  candidates <- list(
    function(observation) observation[, 3] > 0, network, as_policy(tree), policy_random()
  )
  env <- list(observation_space = named_space(four, "CartPole-v1"),
              action_space = discrete_space(2L), spec = list(id = "CartPole-v1"))
  policies <- policy_bind(policy_list(candidates), env)
  angles <- c(1, -1, 1, -1, 1, -1, 1, -1)
  observations <- cbind(0, 0, angles, 0, deparse.level = 0)
  actions <- act_of_rows(policies, observations, rep(1:4, each = 2), env)
  expect_identical(actions[1:6], rep(1:0, 3))
  expect_true(all(actions %in% 0:1))
})

test_that("a policy of a list that gives the wrong number of actions is refused", {
  env <- fake_spaces(four, discrete_space(2L))
  policies <- policy_list(list(function(observation) 1L, function(observation) 1L))
  expect_error(act_of_rows(policies, matrix(0, 3, 4), c(1L, 2L, 2L), env),
               "one action for each of 2 observations, not 1 action", class = "gym_error_argument")
})

test_that("a list of policies without any, or with something else in it, is refused by place", {
  expect_error(rollout("CartPole-v1", list(), client = no_client()),
               "a policy, or a list of at least one", class = "gym_error_argument")
  expect_error(rollout("CartPole-v1", list(policy_random(), 3), client = no_client()),
               "`policy[[2]]` must be a policy or a function of observations, not 3", fixed = TRUE,
               class = "gym_error_argument")
  expect_error(rollout("CartPole-v1", list(policy_random(), function() 1), client = no_client()),
               "`policy[[2]]` must be a function of observations", fixed = TRUE,
               class = "gym_error_argument")
})

test_that("candidates in a list of policies are refused before anything is played", {
  candidates <- policy_candidates(policy_network(c(4, 1)), diag(4))
  expect_error(rollout("CartPole-v1", list(policy_random(), candidates), client = no_client()),
               "`policy[[2]]` must be one policy, not 4 candidates of network 4-1", fixed = TRUE,
               class = "gym_error_argument")
})

test_that("a network acts for a batch of pictures as for each of them", {
  set.seed(3)
  pictures <- box_space(0, 255, shape = c(2L, 3L, 4L), dtype = "uint8")
  env <- fake_spaces(pictures, discrete_space(5L))
  policy <- policy_bind(policy_network(c(24, 5)), env)
  seen <- array(sample(0:255, 6 * 24, replace = TRUE), c(6L, 2L, 3L, 4L))
  alone <- apply(seen, 1L, function(values) act(policy, array(values, c(2L, 3L, 4L))))
  expect_gt(length(unique(alone)), 1L)
  expect_identical(act_of_rows(policy, seen, rep(1L, 6L), env), alone)
})
