observed <- function(n, seed) {
  set.seed(seed)
  cbind(rnorm(n, 1e6, 2), rnorm(n), 7, runif(n, -1, 1) * 1e-9)
}

test_that("moments are those of base R", {
  values <- observed(50, 1)
  moments <- moments_of(values)
  expect_identical(moments$count, 50)
  expect_equal(moments$mean, colMeans(values))
  deviation <- apply(values, 2, sd)
  expect_equal(moments$scale, c(1 / deviation[1:2], 0, 0))
})

test_that("moments that are merged are those of all observations", {
  values <- observed(90, 2)
  parts <- split(seq_len(90), rep(1:3, c(1, 30, 59)))
  merged <- Reduce(merge_moments, lapply(parts, function(rows) {
    moments_of(values[rows, , drop = FALSE])
  }), no_moments())
  expect_equal(merged, moments_of(values))
  expect_identical(merge_moments(merged, no_moments()), merged)
})

test_that("numbers come in less their mean and divided by their deviation, constant ones as 0", {
  values <- observed(50, 3)
  expect_identical(normalized(values, no_moments(), 10), values)
  expect_identical(normalized(values, NULL, 10), values)
  by_hand <- scale(values[, 1:2])
  attributes(by_hand) <- list(dim = c(50L, 2L))
  expect_equal(normalized(values, moments_of(values), 10), cbind(by_hand, 0, 0))
})

test_that("a normalised observation is clipped at 10, or where the policy says", {
  withr::local_seed(1)
  seen <- moments_of(matrix(rnorm(3000, sd = 1e-6)))
  policy <- policy_network(c(1, 1), "identity", list(matrix(1)), normalize = TRUE)
  at <- function(...) {
    policy <- utils::modifyList(policy, list(moments = seen, ...), keep.null = TRUE)
    predict(policy, rbind(1, -1, NaN), type = "output")
  }
  expect_identical(at(), c(10, -10, NaN))
  expect_identical(at(clip_obs = 2.5), c(2.5, -2.5, NaN))
  expect_gt(at(clip_obs = Inf)[[1]], 9e5)
  # Versions that did not clip saved policies without the field.
  expect_identical(at(clip_obs = NULL), at(clip_obs = Inf))
  expect_identical(policy_linear(clip_obs = 5)$clip_obs, 5)
  expect_error(policy_network(clip_obs = 0), "`clip_obs` must be a number above 0, or Inf, not 0",
               class = "gym_error_argument")
})

test_that("pictures are normalised in the order in which R has them", {
  shape <- c(2L, 3L, 2L)
  env <- fake_environment(observation_space = box_space(0, 255, shape, "uint8"),
                          action_space = box_space(c(-Inf, -Inf), c(Inf, Inf)))
  policy <- policy_bind(policy_linear(bias = TRUE, normalize = TRUE), env)
  set.seed(1)
  coef(policy) <- rnorm(26)
  pictures <- array(sample(0:255, 5 * 12, TRUE) + 0, c(5L, shape))
  policy$moments <- moments_of(observation_rows(pictures, env$observation_space)$values)
  acting <- policy_rows(policy, rep(1L, 5))
  expect_s3_class(acting, "gym_policy_by_column")
  expect_equal(act_batch(acting, pictures, 5L, env), act(policy, pictures))
})

test_that("groups stay in the order in which they come, by one key or several", {
  expect_identical(split_in_order(1:4, c(9, 10, 9, 10)), list(`9` = c(1L, 3L), `10` = c(2L, 4L)))
  runs <- split_in_order(1:3, c("b", "a", "b"), c(1, 1, 2))
  expect_identical(unname(runs), list(1L, 2L, 3L))
})
