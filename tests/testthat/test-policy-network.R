test_that("the network of the post has 10 weights between -1 and 1, drawn as there", {
  set.seed(3)
  policy <- policy_network()
  set.seed(3)
  hidden <- matrix(runif(4 * 2, min = -1, max = 1), ncol = 4, nrow = 2)
  output <- runif(2, min = -1, max = 1)
  expect_identical(policy$weights, list(hidden, matrix(output, nrow = 1)))
  set.seed(1)
  weights <- unlist(policy_network(c(100, 100, 1))$weights)
  expect_gt(ks.test(weights, "punif", -1, 1)$p.value, 0.001)
})

test_that("it computes what the post's script computes, each output weight once", {
  set.seed(1)
  policy <- policy_network()
  observations <- matrix(rnorm(400), ncol = 4)
  by_the_post <- apply(observations, 1, function(input) {
    neurons <- numeric(2)
    for (h in 1:2) neurons[h] <- tanh(sum(input * policy$weights[[1]][h, ]))
    round(1 / (1 + exp(-sum(neurons * policy$weights[[2]][1, ]))))
  })
  expect_identical(act(policy, observations), as.integer(by_the_post))
  expect_setequal(by_the_post, 0:1)
})

test_that("an output of exactly one half gives 0, as round() does", {
  expect_identical(act(policy_network(), c(0, 0, 0, 0)), 0L)
})

test_that("many observations give the same actions as one after the other", {
  set.seed(1)
  observations <- matrix(rnorm(40), ncol = 4)
  for (sizes in list(c(4, 1), c(4, 2, 1), c(4, 8, 8, 3))) {
    policy <- policy_network(sizes)
    expect_identical(
      act(policy, observations), apply(observations, 1, function(row) act(policy, row))
    )
  }
})

test_that("every activation is that of the package sigmoid", {
  skip_if_not_installed("sigmoid")
  x <- matrix(c(-30, -2, -0.5, 0, 0.5, 2, 30, 1e-8), nrow = 2)
  for (method in eval(formals(sigmoid::sigmoid)$method)) {
    policy <- policy_network(c(1, 1), c("tanh", method), weights = list(matrix(1)))
    expect_equal(
      network_outputs(policy, cbind(as.vector(x)))[, 1], as.vector(sigmoid::sigmoid(x, method)),
      tolerance = 1e-15, info = method
    )
  }
})

test_that("activations are one of hidden layers and one of outputs, or one for each layer", {
  expect_identical(policy_network(c(4, 3, 3, 1))$activation, c("tanh", "tanh", "logistic"))
  expect_identical(policy_network(c(4, 1))$activation, "logistic")
  expect_identical(policy_network(c(4, 1), "tanh")$activation, "tanh")
  each <- c("logistic", "tanh", "tanh")
  expect_identical(policy_network(c(4, 3, 3, 1), each)$activation, each)
  expect_error(policy_network(activation = "tanh"), "not 1", class = "gym_error_argument")
  expect_error(policy_network(activation = c("tanh", "softmax")), "`activation[2]` must be one of",
               fixed = TRUE, class = "gym_error_argument")
})

test_that("sizes are two or more whole numbers", {
  for (bad in list(4, c(4, 0), c(4, 2.5, 1), c(4, NA, 1), "4-2-1", NULL, NA)) {
    expect_error(policy_network(bad), "sizes", class = "gym_error_argument")
  }
})

test_that("given weights must fit the sizes", {
  weights <- list(matrix(1, 2, 4), matrix(1, 1, 2))
  expect_identical(policy_network(weights = weights)$weights, weights)
  expect_error(policy_network(weights = list(matrix(1, 4, 2), matrix(1, 1, 2))),
               "`weights[[1]]` must be a matrix of 2 x 4 for these sizes, not of 4 x 2.",
               fixed = TRUE, class = "gym_error_argument")
  for (bad in list(weights[1], 1:10, list(1, 2), list(matrix(NA_real_, 2, 4), weights[[2]]))) {
    expect_error(policy_network(weights = bad), class = "gym_error_argument")
  }
})

test_that("given weights leave R's generator alone", {
  set.seed(1)
  state <- .Random.seed
  policy_network(c(1, 1), weights = list(matrix(1)))
  expect_identical(.Random.seed, state)
})

test_that("several outputs take the largest, of equal ones the first, without drawing", {
  policy <- policy_network(c(2, 3), weights = list(rbind(c(1, 0), c(0, 1), c(0, 1))))
  set.seed(1)
  state <- .Random.seed
  expect_identical(act(policy, rbind(c(1, 0), c(0, 1))), c(0L, 1L))
  expect_identical(.Random.seed, state)
})

test_that("discrete actions that do not begin at 0 are shifted", {
  env <- fake_environment(
    observation_space = box_space(-1, 1), action_space = discrete_space(3L, start = -1L)
  )
  policy <- policy_network(c(1, 3), weights = list(cbind(c(-1, 0, 1))))
  bound <- policy_bind(policy, env)
  expect_identical(act(bound, cbind(c(-1, 1))), c(-1L, 1L))
  two <- fake_environment(
    observation_space = box_space(-1, 1), action_space = discrete_space(2L, start = 5L)
  )
  bound <- policy_bind(policy_network(c(1, 1), weights = list(matrix(1))), two)
  expect_identical(act(bound, cbind(c(-1, 1))), c(5L, 6L))
})

test_that("a single output of any bounded activation is rounded at the middle of its range", {
  policy <- policy_network(c(1, 1), c("tanh", "tanh"), weights = list(matrix(1)))
  expect_identical(act(policy, cbind(c(-2, -0.1, 0, 0.1, 2))), c(0L, 0L, 0L, 1L, 1L))
})

test_that("a Box action is scaled to its bounds", {
  env <- fake_environment(
    observation_space = box_space(-1, 1), action_space = box_space(c(-2, 0), c(2, 10))
  )
  for (activation in c("logistic", "tanh")) {
    policy <- policy_network(c(1, 2), c("tanh", activation), weights = list(cbind(c(1, 1))))
    policy <- policy_bind(policy, env)
    expect_equal(act(policy, -1000), c(-2, 0))
    expect_equal(act(policy, 0), c(0, 5))
    expect_equal(act(policy, 1000), c(2, 10))
    expect_equal(act(policy, cbind(c(-1000, 0, 1000))), cbind(c(-2, 0, 2), c(0, 5, 10)))
  }
})

test_that("the scale stays within bounds as wide as numbers go", {
  huge <- 1.7e308
  env <- fake_environment(
    observation_space = box_space(-1, 1), action_space = box_space(-huge, huge, dtype = "float64")
  )
  policy <- policy_bind(policy_network(c(1, 1), weights = list(matrix(1))), env)
  expect_identical(act(policy, 1000), huge)
  expect_identical(act(policy, -1000), -huge)
})

test_that("a Box of whole numbers gets whole numbers, one of arrays arrays", {
  env <- fake_environment(
    observation_space = box_space(-1, 1),
    action_space = box_space(rep(0, 6), 1:6 * 10, shape = c(2L, 3L), dtype = "int32")
  )
  policy <- policy_network(c(1, 6), weights = list(matrix(1, 6, 1)))
  policy <- policy_bind(policy, env)
  expect_identical(act(policy, 1000), rbind(c(10, 20, 30), c(40, 50, 60)))
  many <- act(policy, cbind(c(1000, 0)))
  expect_identical(dim(many), c(2L, 2L, 3L))
  expect_identical(many[1, , ], rbind(c(10, 20, 30), c(40, 50, 60)))
  expect_identical(act(policy, 0.01), round(act(policy, 0.01)))
})

test_that("a discrete observation is one input for each of its values", {
  env <- fake_environment(observation_space = discrete_space(3L, start = 1L))
  policy <- policy_network(c(3, 1), weights = list(rbind(c(1, -1, 1))))
  policy <- policy_bind(policy, env)
  expect_identical(act(policy, 1:3), c(1L, 0L, 1L))
  expect_identical(act(policy, 2L), 0L)
})

test_that("a single output without a range gives its sign", {
  policy <- policy_network(c(1, 1), "identity", weights = list(matrix(2)))
  expect_identical(act(policy, matrix(c(-1, 0, 1e-9), 3)), c(0L, 0L, 1L))
  policy <- policy_network(c(1, 1), "ReLU", weights = list(matrix(2)))
  expect_identical(act(policy, matrix(c(-1, 0, 0.1), 3)), c(0L, 0L, 1L))
})

test_that("a bias is added to what each neuron sums up", {
  weights <- list(rbind(c(1, 2, 0.5), c(0, -1, -0.25)), rbind(c(1, 1, 3)))
  policy <- policy_network(c(2, 2, 1), c("tanh", "identity"), weights, bias = TRUE)
  hidden <- tanh(c(1 * 3 + 2 * 4 + 0.5, -4 - 0.25))
  expect_equal(predict(policy, c(3, 4), "output"), sum(hidden) + 3)
  expect_identical(coef(policy), c(1, 0, 2, -1, 0.5, -0.25, 1, 1, 3))
  expect_identical(lapply(policy_network(c(4, 2, 1), bias = TRUE)$weights, dim),
                   list(c(2L, 5L), c(1L, 3L)))
  expect_error(policy_network(c(2, 2, 1), weights = list(matrix(1, 2, 2), matrix(1, 1, 2)),
                              bias = TRUE),
               "must be a matrix of 2 x 3 for these sizes and a bias", class = "gym_error_argument")
  expect_identical(format(policy), "network 2-2-1, tanh, identity, bias, 9 weights")
})

test_that("candidates with bias and normalized observations act as each by itself", {
  env <- fake_environment(action_space = box_space(c(-1, -1), c(1, 1)))
  policy <- policy_bind(policy_network(c(NA, 3, NA), c("tanh", "tanh"), bias = TRUE,
                                       normalize = TRUE), env)
  set.seed(1)
  observed <- matrix(rnorm(40, 3, 2), 10)
  policy$moments <- moments_of(observed)
  weights <- matrix(rnorm(2 * length(coef(policy))), 2)
  candidates <- policy_candidates(policy, weights)
  which <- rep(1:2, 5)
  together <- act_batch(policy_rows(candidates, which), observed, 10L, env)
  each <- lapply(1:2, function(i) act(policy_subset(candidates, i), observed))
  expect_equal(together[which == 1, ], each[[1]][which == 1, ])
  expect_equal(together[which == 2, ], each[[2]][which == 2, ])
})

test_that("a linear policy is a network of one layer, of weights 0 at first", {
  expect_identical(format(policy_linear()), "network *-*, identity")
  expect_identical(format(policy_linear(bias = TRUE, normalize = TRUE)),
                   "network *-*, identity, bias, normalized observations")
  given <- policy_linear(weights = rbind(c(1, 2, 3)), bias = TRUE)
  expect_identical(given$sizes, c(2L, 1L))
  expect_equal(predict(given, c(10, 100), "output"), 213)
  for (bad in list(1:3, "a", matrix("a"), matrix(0, 0, 3), matrix(NA_real_, 1, 2))) {
    expect_error(policy_linear(weights = bad), "weights", class = "gym_error_argument")
  }
  expect_error(policy_linear(weights = matrix(1), bias = TRUE), class = "gym_error_argument")
  expect_error(policy_linear(bias = 2), "`bias` must be", class = "gym_error_argument")
  expect_error(policy_network(c(NA, 1), weights = list(matrix(1, 1, 4))), "Give all sizes",
               class = "gym_error_argument")
})

test_that("an observation of the wrong length or type is refused with both numbers", {
  expect_error(act(policy_network(), 1:3),
               "The network takes 4 inputs, but the observation has 3 numbers.", fixed = TRUE,
               class = "gym_error_argument")
  expect_error(act(policy_network(), letters[1:4]), "is of type character",
               class = "gym_error_argument")
})

test_that("a network that may act in a Box says once that it takes actions from 0", {
  withr::local_options(rlib_message_verbosity = "verbose")
  unbound <- policy_network(c(1, 3, 1), c("tanh", "tanh"))
  message <- expect_message(expect_true(act(unbound, 0) %in% 0:1), "`policy_bind(policy, env)`",
                            fixed = TRUE, class = "gym_message_unbound")
  expect_match(conditionMessage(message), "takes actions from 0 to 1.", fixed = TRUE)
  expect_message(predict(policy_network(c(1, 3), "identity"), 0), "from 0 to 2",
                 class = "gym_message_unbound")
  expect_no_message({
    predict(unbound, 0, type = "output")
    act(policy_network(c(1, 1)), 0)
    for (output in c("softmax", "gaussian", "epsilon-greedy")) {
      predict(policy_network(c(1, 2), output = output), 0)
      act(policy_network(c(1, 2), output = output), 0, draw = FALSE)
    }
    act(policy_bind(unbound, list(observation_space = box_space(-1, 1),
                                  action_space = box_space(-2, 2))), 0)
  })
  withr::local_options(rlib_message_verbosity = "default")
  rlang::reset_message_verbosity("gym_unbound")
  expect_message(act(unbound, 0), class = "gym_message_unbound")
  expect_no_message(act(unbound, 0))
})

test_that("another draw changes the weights and nothing else", {
  set.seed(1)
  policy <- policy_bind(policy_network(), fake_environment())
  other <- policy_resample(policy)
  expect_false(identical(other$weights, policy$weights))
  policy$weights <- other$weights
  expect_identical(other, policy)
})

test_that("a network prints in one line", {
  expect_output(
    print(policy_network()), "<policy: network 4-2-1, tanh, logistic, 10 weights>", fixed = TRUE
  )
})

test_that("a discrete observation out of range is an error", {
  space <- new_space(list(name = "Discrete", n = 4L, start = 1L))
  policy <- policy_network(c(4, 2))
  policy$observation_space <- space
  expect_length(act(policy, 1:4), 4)
  for (wrong in list(0L, 5L, NA_integer_, 1.5, c(1L, 7L), "a")) {
    expect_error(act(policy, wrong), "from 1 to 4", class = "gym_error_argument")
  }
})

test_that("weights that were given another shape by hand are named", {
  policy <- policy_network()
  policy$weights[[1]] <- matrix(0, 4, 2)
  refusal <- "`policy$weights[[1]]` must be a matrix of 2 x 4 for these sizes, not of 4 x 2."
  for (call in list(function() act(policy, 1:4), function() rollout(fake_environment(), policy),
                    function() plot(policy))) {
    cnd <- expect_error(call(), refusal, fixed = TRUE, class = "gym_error_argument")
    expect_match(conditionMessage(cnd), "`t()` transposes it", fixed = TRUE)
  }
  expect_error(policy_network(weights = numeric(10)), "a list of 2 matrices (2 x 4, 1 x 2)",
               fixed = TRUE, class = "gym_error_argument")
})

test_that("orthogonal weights stand at right angles, and are small where actions are drawn", {
  set.seed(1)
  policy <- policy_network(c(6, 4, 5, 3), bias = TRUE, output = "softmax", init = "orthogonal")
  weights <- lapply(policy$weights, function(layer) layer[, -ncol(layer)])
  expect_equal(tcrossprod(weights[[1]]), 2 * diag(4))
  expect_equal(crossprod(weights[[2]]), 2 * diag(4))
  expect_equal(tcrossprod(weights[[3]]), 1e-4 * diag(3))
  expect_identical(policy$weights[[2]][, 5], numeric(5))
  values <- policy_network(c(6, 4, 3), c("tanh", "identity"), init = "orthogonal")
  expect_equal(tcrossprod(values$weights[[2]]), diag(3))
})

test_that("a network that draws, draws by its probabilities; without draws it takes the best", {
  set.seed(1)
  observation <- matrix(1, 4000, 1)
  near <- function(x, y) expect_lt(max(abs(x - y)), 0.03)
  logits <- log(c(0.1, 0.6, 0.3))
  softmax <- policy_network(c(1, 3), weights = list(cbind(logits)), output = "softmax")
  near(tabulate(act(softmax, observation) + 1L, 3) / 4000, exp(logits))
  expect_equal(predict(softmax, 1, "probability"), rbind(exp(logits)))
  expect_identical(c(act(softmax, 1, draw = FALSE), predict(softmax, 1)), c(1L, 1L))
  greedily <- policy_network(
    c(1, 3), weights = list(cbind(logits)), output = "epsilon-greedy", epsilon = 0.3
  )
  expect_equal(predict(greedily, 1, "probability"), rbind(c(0.1, 0.8, 0.1)))
  near(tabulate(act(greedily, observation) + 1L, 3) / 4000, c(0.1, 0.8, 0.1))
  gaussian <- policy_network(
    c(1, 2), weights = list(cbind(c(5, -5))), output = "gaussian", log_std = log(c(0.1, 0.5))
  )
  drawn <- act(gaussian, observation)
  near(c(colMeans(drawn), apply(drawn, 2, sd)), c(5, -5, 0.1, 0.5))
  expect_identical(act(gaussian, 1, draw = FALSE), c(5, -5))
  expect_identical(coef(gaussian), c(5, -5, log(c(0.1, 0.5))))
  coef(gaussian) <- c(0, 1, 2, 3)
  expect_identical(gaussian$log_std, c(2, 3))
  expect_error(predict(gaussian, 1, "probability"), class = "gym_error_argument")
})

test_that("an output is refused where it does not fit, and NA is the environment's own", {
  box <- fake_environment(action_space = box_space(c(-1, -1), c(1, 1)))
  own <- policy_network(c(NA, 3, NA), output = NA)
  expect_identical(format(own), "network *-3-*, tanh, identity")
  expect_identical(policy_bind(own, box)$output, "gaussian")
  expect_identical(policy_bind(own, box)$log_std, c(0, 0))
  two <- policy_bind(own, fake_environment())
  expect_identical(two$output, "softmax")
  expect_identical(two$sizes, c(4L, 3L, 2L))
  for (output in c("softmax", "epsilon-greedy")) {
    expect_error(policy_bind(policy_network(c(NA, NA), "identity", output = output), box),
                 "needs a Discrete action space", class = "gym_error_argument")
  }
  gaussian <- policy_network(c(NA, NA), "identity", output = "gaussian")
  expect_error(policy_bind(gaussian, fake_environment()), "Box", class = "gym_error_argument")
  expect_error(policy_network(c(2, 2), c("tanh", "tanh"), output = "softmax"),
               "\"identity\", not of \"tanh\"", class = "gym_error_argument")
  expect_error(policy_network(c(2, 2), output = "gaussian", log_std = 1:3), "log_std",
               class = "gym_error_argument")
  expect_error(policy_network(output = "soft"), class = "gym_error_argument")
})
