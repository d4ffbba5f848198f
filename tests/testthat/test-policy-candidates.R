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
