test_that("the weights are one vector, layer after layer, each matrix column after column", {
  policy <- policy_network(c(2, 3, 1), weights = list(matrix(1:6 / 10, 3), matrix(7:9 / 10, 1)))
  expect_identical(coef(policy), 1:9 / 10)
  set.seed(1)
  drawn <- runif(10, -1, 1)
  set.seed(1)
  expect_identical(coef(policy_network(c(4, 2, 1))), drawn)
})

test_that("weights that are set are those that act, and nothing else changes", {
  policy <- policy_network(c(4, 3, 2))
  other <- policy_network(c(4, 3, 2))
  changed <- other
  coef(changed) <- coef(policy)
  expect_identical(changed, policy)
  expect_identical(lapply(changed$weights, dim), list(c(3L, 4L), c(2L, 3L)))
  coef(changed) <- stats::setNames(1:18, letters[1:18])
  expect_identical(coef(changed), as.numeric(1:18))
  expect_null(names(changed$weights[[1]]))
})

test_that("weights that do not fit are refused", {
  policy <- policy_network(c(4, 2, 1))
  set <- function(value) coef(policy) <- value
  expect_error(set(1:9),
               "must be a vector of 10 numbers, not an integer vector of length 9", fixed = TRUE,
               class = "gym_error_argument")
  expect_error(set(c(1:9, NA)), "without missing values", class = "gym_error_argument")
  expect_error(set(c(1:9, NaN)), "without missing values", class = "gym_error_argument")
  expect_error(set(letters[1:10]), "a vector of 10 numbers", class = "gym_error_argument")
  expect_error(set(NULL), "a vector of 10 numbers, not NULL", class = "gym_error_argument")
})

test_that("a policy without weights says so", {
  policy <- policy_random()
  expect_error(coef(policy), "a policy with weights, not random", class = "gym_error_argument")
  expect_error(coef(policy) <- 1, "a policy with weights, not random",
               class = "gym_error_argument")
  follow <- function(observation) 1L
  expect_error(coef(follow) <- 1, "a policy with weights, not a function",
               class = "gym_error_argument")
})
