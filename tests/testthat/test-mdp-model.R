test_that("a typed table is a model, with what was left out filled in", {
  model <- walk_model(id = "Walk", max_episode_steps = 10)
  expect_s3_class(model, "gym_model")
  table <- as.data.frame(model)
  expect_identical(names(table),
                   c("state", "action", "next_state", "probability", "reward", "terminated"))
  expect_identical(table$terminated, c(TRUE, FALSE, FALSE, TRUE))
  expect_identical(table$probability, rep(1, 4))
  expect_identical(model$start, c("0" = 0, "1" = 1, "2" = 0, "3" = 0))
  expect_output(
    print(model), "<model of Walk: 4 states, 2 actions, 4 transitions, starts in state 1>",
    fixed = TRUE
  )
})

test_that("numbers of states and actions need not begin at 0", {
  table <- walk_table()
  table[c("state", "next_state")] <- table[c("state", "next_state")] + 10
  table$action <- table$action + 1
  model <- gym_model(table, start = 11)
  expect_identical(names(model$start), c("10", "11", "12", "13"))
  solved <- solve_mdp(model)
  expect_identical(colnames(solved$q), c("1", "2"))
  expect_identical(solved$actions[2:3], c(2L, 2L))
  expect_identical(predict(solved, 11L), 2L)
})

test_that("without a start episodes begin in any state that is left", {
  expect_equal(unname(gym_model(walk_table())$start), c(0, 0.5, 0.5, 0))
  expect_equal(unname(gym_model(walk_table(), start = c(0, 0.2, 0.8, 0))$start), c(0, 0.2, 0.8, 0))
})

test_that("episodes start in one of several states, or by the probabilities of some", {
  start_of <- function(start) unname(gym_model(walk_table(), start = start)$start)
  expect_equal(start_of(c(2, 1)), c(0, 0.5, 0.5, 0))
  expect_equal(start_of(c("2" = 0.8, "1" = 0.2)), c(0, 0.2, 0.8, 0))
  expect_equal(start_of(gym_model(walk_table(), start = 2)$start), c(0, 0, 1, 0))
  # As many elements as states are probabilities.
  two <- data.frame(state = c(0, 1), action = 0, next_state = 1, reward = 0, terminated = TRUE)
  expect_equal(unname(gym_model(two, start = c(0, 1))$start), c(0, 1))
})

test_that("what is no model is refused by name", {
  refused <- function(table, text, ...) {
    expect_error(gym_model(table, ...), text, class = "gym_error_argument", fixed = TRUE)
  }
  refused(3, "`transitions` must be a data frame")
  refused(walk_table()[0, ], "with a row for each transition, not a data frame with 0 rows")
  expect_error(estimate_model(walk_table()[0, ]), "not a data frame with 0 rows",
               class = "gym_error_argument")
  refused(walk_table()[-4], "`transitions` has no column `reward`")
  wrong <- walk_table()
  wrong$probability <- c(1, 1, 0.5, 1)
  refused(wrong, "The probabilities of action 0 in state 2 add up to 0.5, not to 1.")
  wrong$probability[[3]] <- 1.5
  refused(wrong, "in row 3 it has 1.5")
  wrong <- walk_table()
  wrong$reward[[2]] <- NA
  refused(wrong, "The column `reward` of `transitions` must have finite numbers")
  wrong <- walk_table()
  wrong$state[[1]] <- 0.5
  refused(wrong, "must have whole numbers, and in row 1 it has 0.5")
  wrong <- walk_table()
  wrong$terminated <- c(TRUE, FALSE, FALSE, FALSE)
  refused(wrong, "No row leaves state 3, and arriving there does not end the episode.")
  refused(walk_table(), "`start` must be the number of a state that some row leaves", start = 3)
  refused(walk_table(), "one for each of 4 states", start = c(0.5, 0.5))
  refused(walk_table(), "`start` must be the number of a state that some row leaves",
          start = c(1, 0, 0, 0))
  refused(walk_table(), "`start` must be the numbers of states", start = c(1, 9))
  refused(walk_table(), "`start` must be the numbers of states", start = c(1, 1))
  refused(walk_table(), "`start` must be the numbers of states", start = c("1" = 0.5, a = 0.5))
  refused(walk_table(), "with the states' numbers as names", start = c("1" = 0.5, "2" = 0.6))
})

test_that("a model is arrays for other packages, with a state for the end", {
  arrays <- model_arrays(walk_model())
  expect_identical(dim(arrays$P), c(5L, 5L, 2L))
  expect_true(all(apply(arrays$P, 3, rowSums) == 1))
  expect_identical(arrays$P["1", "2", "1"], 1)
  expect_identical(arrays$P["2", "end", "1"], 1)
  expect_identical(arrays$R["2", "1"], 1)
  expect_identical(arrays$start[["1"]], 1)
  # Value iteration as any textbook has it gives the same values.
  values <- numeric(5)
  for (sweep in 1:50) {
    q <- sapply(1:2, function(a) arrays$R[, a] + 0.9 * drop(arrays$P[, , a] %*% values))
    values <- apply(q, 1, max)
  }
  expect_equal(unname(values[1:4]), unname(solve_mdp(walk_model(), discount = 0.9)$values))
})

test_that("an action that a state does not have leads to the end for a reward of -Inf", {
  arrays <- model_arrays(gym_model(walk_table()[-3, ], start = 1))
  expect_identical(arrays$R["2", "0"], -Inf)
  expect_identical(arrays$P["2", "end", "0"], 1)
})

test_that("a model is estimated by the shares of what was played", {
  played <- data.frame(
    episode = c(1, 1, 2, 2, 3), state = c(0, 1, 0, 1, 0), action = c(1, 1, 1, 1, 1),
    next_state = c(1, 2, 1, 0, 2), reward = c(0, 1, 0, 0, 1),
    terminated = c(FALSE, TRUE, FALSE, FALSE, TRUE)
  )
  model <- estimate_model(played)
  table <- as.data.frame(model)
  expect_equal(table$probability[table$state == 0 & table$next_state == 1], 2 / 3)
  expect_equal(table$probability[table$state == 1], c(0.5, 0.5))
  expect_equal(unname(model$start), c(1, 0, 0))
})

test_that("episodes start at their lowest steps, whatever the order of the rows", {
  played <- rollout(walk_model(), policy_random(), episodes = 20, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  model <- estimate_model(played)
  set.seed(1)
  played$steps <- played$steps[sample(nrow(played$steps)), ]
  expect_identical(estimate_model(played)$start, model$start)
  table <- stats::setNames(played$steps, sub("obs_1", "state", names(played$steps)))
  expect_identical(estimate_model(table)$start, model$start)
  # In order, and nothing else is known.
  table <- table[order(table$episode, table$step), ]
  expect_identical(estimate_model(table[setdiff(names(table), "step")])$start, model$start)
  expect_identical(
    estimate_model(table[setdiff(names(table), c("episode", "step"))])$start, model$start
  )
})

test_that("rows that are not in order are refused, and so is a step without an episode", {
  refused <- function(table, text) {
    expect_error(estimate_model(table), text, class = "gym_error_argument", fixed = TRUE)
  }
  played <- data.frame(
    episode = c(1, 1, 2, 2), step = c(1, 2, 1, 2), state = c(0, 1, 0, 1), action = 0,
    next_state = c(1, 2, 1, 2), reward = 0, terminated = c(FALSE, TRUE)
  )
  expect_identical(estimate_model(played)$start, c("0" = 1, "1" = 0, "2" = 0))
  refused(played[c(2, 1, 3, 4), -2],
          "Row 2 of `x` does not follow row 1: that one leads to state 2, where the episode ends")
  refused(played[c(1, 3, 2, 4), -(1:2)], "leads to state 1, and row 2 starts in state 0")
  refused(played[-1], "Row 3 of `x` is another step 1 of the same episode.")
  played$step[[2]] <- NA
  refused(played, "The column `step` of `x` must have whole numbers, and in row 2 it has NA")
  played$episode[[2]] <- NA
  refused(played, "The column `episode` of `x` must have a number or a name, and in row 2")
})

test_that("a state that was never left counts as an end, and that is said", {
  played <- data.frame(state = c(0, 1), action = 0, next_state = c(1, 2), reward = 0,
                       terminated = FALSE)
  expect_message(model <- estimate_model(played), class = "gym_message_model")
  expect_identical(as.data.frame(model)$terminated, c(FALSE, TRUE))
})

test_that("an estimated model comes near to the one that was played", {
  played <- rollout(walk_model(), policy_random(), episodes = 3000, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  estimated <- estimate_model(played)
  expect_identical(as.data.frame(estimated), as.data.frame(walk_model()))
  expect_error(estimate_model(rollout(walk_model(), policy_random(), seed = 1)),
               "steps = TRUE, next_observation = TRUE", class = "gym_error_argument")
  expect_error(estimate_model(3), class = "gym_error_argument")
})

test_that("one state is a model, too, and so is one of a tibble", {
  one <- estimate_model(data.frame(
    state = 3, action = 0:1, next_state = 3, reward = 0:1, terminated = TRUE
  ))
  expect_identical(one$start, c("3" = 1))
  testthat::skip_if_not_installed("tibble")
  expect_silent(model <- gym_model(tibble::as_tibble(walk_table()), start = 1))
  expect_identical(as.data.frame(model), as.data.frame(walk_model()))
})

test_that("an estimated model has all states of the environment that was played", {
  q <- matrix(c(1, 0), 4, 2, byrow = TRUE)
  played <- rollout(walk_model(), policy_table(q), episodes = 5, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  expect_length(estimate_model(played)$start, 4)
})

test_that("numbers with gaps that no memory holds are refused", {
  far <- walk_table()
  far$next_state[[4]] <- 3e8
  expect_error(gym_model(far, start = 1), "numbered from 0 to 300000000",
               class = "gym_error_argument")
})
