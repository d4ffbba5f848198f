test_that("the largest value's action is taken, of equal ones the first", {
  policy <- policy_table(rbind(c(0, 1, 0), c(2, 0, 2), c(-Inf, -5, -7)))
  expect_identical(act(policy, 0L), 1L)
  expect_identical(act(policy, 0:2), c(1L, 0L, 1L))
  expect_output(print(policy), "<policy: table 3 x 3>", fixed = TRUE)
})

test_that("epsilon explores among the actions that can be taken, as often as it says", {
  policy <- policy_table(rbind(c(0, 1, -Inf, 0)), epsilon = 0.3)
  set.seed(1)
  actions <- act(policy, rep(0L, 30000))
  shares <- tabulate(actions + 1L, 4) / 30000
  expect_equal(shares, c(0.1, 0.8, 0, 0.1), tolerance = 0.03)
  expect_equal(row_probabilities(policy, policy$q)[1, ], c(0.1, 0.8, 0, 0.1))
})

test_that("the softmax draws in proportion to the exponential of values", {
  policy <- policy_table(rbind(c(0, log(2), -Inf) * 5), temperature = 5)
  set.seed(1)
  actions <- act(policy, rep(0L, 30000))
  expect_equal(tabulate(actions + 1L, 3) / 30000, c(1 / 3, 2 / 3, 0), tolerance = 0.02)
  expect_equal(row_probabilities(policy, policy$q)[1, ], c(1 / 3, 2 / 3, 0))
})

test_that("a table with rows for pairs is asked about Tuple and MultiDiscrete", {
  q <- diag(6)
  pairs <- list(observation_space = space_multi_discrete(c(2, 3)),
                action_space = space_discrete(6), spec = list(id = "Pairs"))
  policy <- policy_bind(policy_table(q), pairs)
  expect_identical(act_batch(policy, rbind(c(0, 0), c(0, 2), c(1, 0)), 3L, NULL), c(0L, 2L, 3L))
  expect_identical(act(policy, c(1, 2)), 5L)
  pairs$observation_space <- space_tuple(space_discrete(2), space_discrete(3))
  policy <- policy_bind(policy_table(q), pairs)
  expect_identical(act(policy, list(1L, 1L)), 4L)
  expect_identical(act_batch(policy, list(c(0L, 1L), c(2L, 2L)), 2L, NULL), c(2L, 5L))
})

test_that("values of several dimensions are numbered as their array is written row by row", {
  index <- space_index(space_multi_binary(c(2, 2)))
  batch <- array(0L, c(2, 2, 2))
  batch[1, 1, 2] <- 1L
  batch[2, 2, 1] <- 1L
  expect_identical(index$index(batch, 2L), c(1L + 4L, 1L + 2L))
  expect_identical(index$count, 16)
})

test_that("tables that do not fit are refused", {
  refused <- function(code, text) {
    expect_error(code, text, class = "gym_error_argument", fixed = TRUE)
  }
  refused(policy_table(1:3), "`q` must be a numeric matrix")
  refused(act(policy_table(rbind(c(-Inf, -Inf))), 0L), "Row 1 of the policy's table leaves no")
  refused(policy_table(diag(2), epsilon = 2), "`epsilon` must be a number from 0 to 1")
  refused(policy_table(diag(2), temperature = 0), "`temperature` must be a number above 0")
  refused(rollout(walk_model(), policy_table(diag(3))),
          "The policy's table has 3 rows and 3 columns, but R-model has 4 states and 2 actions.")
  refused(act(policy_table(diag(2)), 2L), "no row for the observation 2")
  box <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)))
  refused(rollout(box, policy_table(diag(2))), "observations that can be counted")
})
