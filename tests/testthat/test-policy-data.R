# Policies as data: what a server plays without asking R.

env <- list(
  observation_space = space_box(-1, 1, c(2, 3)), action_space = space_discrete(3),
  spec = list(id = "Odd-v0")
)

test_that("the weights of a network are those of coef(), a candidate in each row", {
  policy <- policy_bind(policy_linear(bias = TRUE, weights = matrix(sin(1:21), 3)), env)
  data <- policy_data(policy, env)
  expect_identical(data$tensors, list(weights = rbind(coef(policy))))
  expect_identical(
    to_json(data$document),
    paste0('{"kind":"network","sizes":[6,3],"activation":["identity"],"bias":true,',
           '"output":"greedy"}')
  )
  weights <- rbind(a = coef(policy), b = 2 * coef(policy))
  several <- policy_data(policy_bind(policy_candidates(policy, weights), env), env)
  expect_identical(several$document, data$document)
  expect_identical(several$tensors, list(weights = unname(weights)))
})

test_that("moments go along where some are known", {
  policy <- policy_bind(policy_linear(normalize = TRUE), env)
  expect_named(policy_data(policy, env)$tensors, "weights")
  policy$moments <- new_moments(3, as.numeric(1:6), c(0, 2, 4, 6, 8, 10))
  tensors <- policy_data(policy, env)$tensors
  expect_identical(tensors$mean, as.numeric(1:6))
  expect_identical(tensors$scale, policy$moments$scale)
})

test_that("a random policy names its actions where they are fewer than the environment's", {
  whole <- policy_bind(policy_random(), env)
  expect_identical(
    policy_data(whole, env), list(document = list(kind = "random"), tensors = list())
  )
  narrow <- policy_bind(policy_random(space_discrete(2, start = 1)), env)
  expect_identical(
    to_json(policy_data(narrow, env)$document),
    '{"kind":"random","action_space":{"n":2,"start":1}}'
  )
  box <- list(
    observation_space = env$observation_space, action_space = space_box(-1, 1, 2L),
    spec = env$spec
  )
  narrow <- policy_bind(policy_random(space_box(0, 1, 2L)), box)
  expect_null(policy_data(narrow, box))
  masked <- whole
  masked$possible <- matrix(TRUE, 2, 3)
  expect_null(policy_data(masked, env))
})

test_that("a table is its values, and how they are acted on", {
  lake <- list(
    observation_space = space_discrete(2), action_space = space_discrete(3), spec = env$spec
  )
  policy <- policy_bind(policy_table(matrix(c(1:5, -Inf), 2), epsilon = 0.25), lake)
  data <- policy_data(policy, lake)
  expect_identical(to_json(data$document), '{"kind":"table","epsilon":0.25,"temperature":null}')
  expect_identical(data$tensors$q, policy$q)
  tensor <- data_tensor(data$tensors$q, "F64")
  expect_identical(tensor$shape, c(2L, 3L))
  expect_identical(readBin(tensor$bytes, "double", 6L), c(1, 3, 5, 2, 4, -Inf))
})

test_that("a list numbers its tensors, and is no data where one of it is none", {
  network <- policy_bind(policy_linear(weights = matrix(sin(1:18), 3)), env)
  both <- policy_list(list(a = policy_bind(policy_random(), env), b = network))
  data <- policy_data(both, env)
  expect_named(data$tensors, "1/weights")
  expect_identical(data$document$kind, "list")
  expect_identical(data$document$policies[[1]], list(kind = "random"))
  expect_null(policy_data(policy_list(list(network, function(observation) 0L)), env))
})

test_that("what acts by R's code is no data", {
  expect_null(policy_data(function(observation) 0L, env))
  own <- policy_bind(policy_linear(), env)
  class(own) <- c("my_policy", class(own))
  expect_null(policy_data(own, env))
})
