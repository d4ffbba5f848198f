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
          "The policy's table has 3 rows and 3 columns, but R-model has 4 states and 2 actions: ")
  refused(act(policy_table(diag(2)), 2L), "no row for the observation 2")
  box <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)))
  refused(rollout(box, policy_table(diag(2))), "observations that can be counted")
})

test_that("what is no state of the table is refused in words, wherever it stands", {
  refused <- function(policy, observation, named) {
    for (ask in list(act, function(...) predict(..., type = "output"))) {
      cnd <- expect_error(ask(policy, observation), class = "gym_error_argument")
      expect_match(conditionMessage(cnd), paste("no row for the observation", named), fixed = TRUE)
    }
  }
  states <- policy_table(diag(4))
  refused(states, 1.5, "1.5")
  refused(states, c(1, -0.5), "-0.5")
  refused(states, c(0, NA), "NA")
  refused(states, "1", "\"1\"")
  expect_error(act(states, NULL), "an observation, not NULL", class = "gym_error_argument")
  cnd <- expect_error(act(states, 1.5))
  expect_match(conditionMessage(cnd), "one for each value of <Discrete 4>", fixed = TRUE)
  expect_error(act(states, cbind(0:1, 0:1)), "several", class = "gym_error_argument")

  pairs <- list(observation_space = space_multi_discrete(c(2, 2)),
                action_space = space_discrete(4), spec = list(id = "Pairs"))
  numbers <- policy_bind(states, pairs)
  refused(numbers, c(1, 0.5), "c(1, 0.5)")
  refused(numbers, rbind(c(0, 1), c(0, 2)), "c(0, 2)")
  refused(numbers, c(0, 1, 1), "c(0, 1, 1)")
  for (space in list(space_tuple(space_discrete(2), space_discrete(2)),
                     space_dict(a = space_discrete(2), b = space_discrete(2)))) {
    pairs$observation_space <- space
    parts <- policy_bind(states, pairs)
    keys <- names(space$spaces)
    refused(parts, stats::setNames(list(0, 2), keys), "list(")
    refused(parts, stats::setNames(data.frame(c(0, 0.5), c(1, 1)), keys %||% 1:2), "list(")
    for (bad in list(stats::setNames(list(1, 0.5), keys), 3)) {
      expect_error(act(parts, bad), class = "gym_error_space")
    }
    expect_identical(act(parts, stats::setNames(data.frame(0:1, 1:0), keys %||% 1:2)), 1:2)
  }
})

test_that("a learner is not taught by an observation that is no state", {
  half <- list(
    observation_space = space_discrete(3), action_space = space_discrete(2),
    spec = list(id = "Half"), reset = function(seed = NULL) 1,
    step = function(action) {
      list(observation = 1.5, reward = 1, terminated = FALSE, truncated = TRUE)
    }
  )
  cnd <- expect_error(learn_q(half, iterations = 2, seed = 1), class = "gym_error_argument")
  expect_match(conditionMessage(cnd$parent), "no row for the observation 1.5", fixed = TRUE)
})

test_that("a table whose names are numbers in another order is refused with the fix", {
  q <- matrix(0, 3, 2, dimnames = list(c(0, 10, 2), 0:1))
  expect_error(policy_table(q), "`q[order(as.numeric(rownames(q))), ]` is", fixed = TRUE,
               class = "gym_error_argument")
  expect_error(policy_table(q[c(1, 3, 2), 2:1]), "the order of their numbers, not `1`, `0`",
               class = "gym_error_argument")
  expect_no_error(policy_table(q[c(1, 3, 2), ]))
  expect_no_error(policy_table(`colnames<-`(q[c(1, 3, 2), ], c("left", "right"))))
})

test_that("an observation without a row is no error of an inner function", {
  failed <- expect_error(act(policy_table(q = matrix(0, 2, 2)), 5), "no row for the observation 5",
                         class = "gym_error_argument")
  expect_null(failed$call)
})
