central_differences <- function(f, x, step = 1e-6) {
  vapply(seq_along(x), function(i) {
    at <- function(sign) f(replace(x, i, x[[i]] + sign * step))
    (at(1) - at(-1)) / (2 * step)
  }, 0)
}

test_that("gradients are those of central differences, in every activation, output, bias, scale", {
  set.seed(1)
  observation <- matrix(rnorm(21), 7)
  cases <- expand.grid(
    activation = activations, output = c("softmax", "gaussian", "greedy"), bias = c(FALSE, TRUE),
    normalize = c(FALSE, TRUE), stringsAsFactors = FALSE
  )
  cases$error <- mapply(function(activation, output, bias, normalize) {
    greedy <- output == "greedy"
    policy <- policy_network(
      c(3, 5, 4, 2), c(activation, if (greedy) activation else "identity"), bias = bias,
      normalize = normalize, output = output, log_std = c(-0.5, 0.2)
    )
    if (normalize) policy$moments <- moments_of(matrix(rnorm(30, 1, 2), 10))
    weights <- if (greedy) matrix(rnorm(14), 7) else rnorm(7)
    action <- act(policy, observation)
    sum_with <- function(w) {
      coef(policy) <- w
      if (greedy) {
        sum(weights * predict(policy, observation, "output"))
      } else {
        sum(weights * policy_log_prob(policy, observation, action))
      }
    }
    gradient <- if (greedy) {
      policy_output_gradient(policy, observation, weights)
    } else {
      policy_log_prob_gradient(policy, observation, action, weights)
    }
    wanted <- central_differences(sum_with, coef(policy))
    max(abs(gradient - wanted)) / max(abs(wanted), 1)
  }, cases$activation, cases$output, cases$bias, cases$normalize)
  expect_identical(cases[cases$error > 1e-6, ], cases[0, ])
})

test_that("log-probabilities are those of R's distributions, of numbers beyond the bounds too", {
  set.seed(1)
  softmax <- policy_network(c(2, 3), output = "softmax")
  observation <- matrix(rnorm(10), 5)
  action <- c(0L, 1L, 2L, 0L, 1L)
  probability <- predict(softmax, observation, "probability")
  expect_equal(policy_log_prob(softmax, observation, action),
               log(probability[cbind(1:5, action + 1L)]))
  gaussian <- policy_bind(
    policy_network(c(NA, NA), "identity", output = "gaussian", log_std = c(0.3, -0.3)),
    fake_environment(action_space = box_space(c(-1, -1), c(1, 1)))
  )
  observation <- matrix(rnorm(20), 5)
  action <- matrix(rnorm(10, sd = 5), 5)
  mean <- predict(gaussian, observation, "output")
  each <- dnorm(action, mean, rep(exp(c(0.3, -0.3)), each = 5), log = TRUE)
  expect_equal(policy_log_prob(gaussian, observation, action), rowSums(each))
})

test_that("Discrete observations are one column each, and actions begin where the space does", {
  env <- fake_environment(
    observation_space = discrete_space(3L, start = 1L),
    action_space = discrete_space(2L, start = 5L)
  )
  policy <- policy_network(c(3, 2), weights = list(rbind(c(1, 2, 3), 0)), output = "softmax")
  policy <- policy_bind(policy, env)
  expect_equal(policy_log_prob(policy, 1:3, c(5L, 6L, 5L)),
               plogis(c(1, 2, 3) * c(1, -1, 1), log.p = TRUE))
  gradient <- policy_log_prob_gradient(policy, 2L, 5L)
  expect_equal(gradient, c(0, 0, 1, -1, 0, 0) * plogis(-2))
})

test_that("what does not fit is refused", {
  softmax <- policy_network(c(2, 3), output = "softmax")
  observation <- matrix(0, 2, 2)
  refused <- function(code, argument) {
    cnd <- expect_error(code, class = "gym_error_argument")
    expect_identical(cnd$argument, argument)
  }
  refused(policy_log_prob(policy_network(c(2, 3)), observation, c(0, 0)), "policy")
  refused(policy_output_gradient(policy_random(), observation), "policy")
  refused(policy_log_prob(softmax, matrix(0, 2, 3), c(0, 0)), "observation")
  refused(policy_log_prob(softmax, observation, 0), "action")
  refused(policy_log_prob(softmax, observation, c(0, 3)), "action")
  refused(policy_log_prob_gradient(softmax, observation, c(0, 1), 1:3), "weights")
  refused(policy_output_gradient(softmax, observation, 1:2), "weights")
})

test_that("a session with R's own BLAS computes the same gradient as one with a fast one", {
  set.seed(1)
  policy <- policy_network(c(3, 5, 4, 2), output = "softmax", bias = TRUE)
  observation <- matrix(rnorm(21), 7)
  action <- rbinom(7, 1, 0.5)
  gradient_with <- function(reference) {
    before <- the_session$reference_blas
    withr::defer(the_session$reference_blas <- before)
    the_session$reference_blas <- reference
    policy_log_prob_gradient(policy, observation, action)
  }
  expect_equal(gradient_with(TRUE), gradient_with(FALSE), tolerance = 1e-12)
  expect_true(any(gradient_with(TRUE) != 0))
})
