visits <- function() {
  data.frame(
    patient = c("b", "a", "a", "b", "b"), visit = c(2, 2, 1, 1, 3),
    severity = c("high", "low", "high", "low", "low"), age = c(41, 60, 60, 41, 41),
    drug = c("new", "old", "new", "old", "old"), y = c(1, 3, 1, 2, 3)
  )
}
visit_steps <- function(data = visits(), ...) {
  steps_data(data, "patient", c("severity", "age"), "drug", "y", time = "visit", ...)
}

test_that("steps are sorted, and the next state comes from the following row", {
  steps <- as.data.frame(visit_steps())
  expect_equal(steps$episode, c("b", "b", "b", "a", "a"))
  expect_equal(steps$step, c(1:3, 1:2))
  expect_equal(steps$reward, c(2, 1, 3, 1, 3))
  expect_equal(steps$next_severity, c("high", "low", NA, "low", NA))
  expect_equal(steps$terminated, c(FALSE, FALSE, TRUE, FALSE, TRUE))
})

test_that("selected rows, and the steps of a rollout, are steps", {
  steps <- visit_steps()
  some <- steps_of(steps[steps$episode == "a", ])
  expect_equal(some$episodes, 1L)
  expect_equal(some$reward, c(1, 3))
  walk <- gym_model(data.frame(
    state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
    reward = c(0, 0, 0, 1)
  ), start = 1, max_episode_steps = 3)
  played <- rollout(walk, policy_random(), episodes = 20, seed = 1, steps = TRUE)
  steps <- steps_of(played)
  expect_equal(steps, steps_of(played$steps))
  expect_equal(steps$episodes, 20L)
  expect_length(steps$cut, sum(!played$episodes$terminated))
})

test_that("the state may have the names of a grid's columns", {
  data <- data.frame(episode = 1, row = 1:3, column = 3:1, action = "a", reward = 0)
  expect_equal(steps_of(data)$state, data[c("row", "column")])
})

test_that("steps print what they are", {
  expect_snapshot(print(visit_steps()))
})

test_that("invalid steps are errors that name the rows", {
  wrong <- function(change, ...) {
    data <- visits()
    expect_error(visit_steps(change(data), ...), class = "gym_error_argument")$message
  }
  expect_match(wrong(function(d) replace(d, "y", replace(d$y, 2:3, NA))), "in 2 rows: 2, 3")
  expect_match(wrong(function(d) replace(d, "visit", 1)), "same episode with the same `visit`")
  twice <- function(d) cbind(d, end = d$visit == 2, p = 0)
  expect_match(wrong(twice, terminated = "end"), "Episode b ends in row 1 .* goes on in row 5")
  expect_match(wrong(twice, probability = "p"), "above 0 and at most 1.* in row 1 it has 0")
  expect_match(wrong(function(d) d[-3]), "no column `severity`")
  expect_error(
    steps_data(data.frame(episode = 1, x = 1, action = 0.5, reward = 1)), "`cut\\(\\)`"
  )
  expect_error(
    steps_data(data.frame(episode = 1, step = 1, action = 1, reward = 1), state = "step"),
    "another name"
  )
})

# The best treatment is the new drug if the state is high, the old one if it is low, in a dose of 5.
drugs_and_doses <- function() {
  data <- expand.grid(
    severity = c("low", "high"), drug = c("new", "old"), dose = c(1, 5), again = 1:6,
    stringsAsFactors = FALSE
  )
  data$patient <- seq_len(nrow(data))
  data$y <- (data$severity == "high") * (data$drug == "new") * 2 +
    (data$severity == "low") * (data$drug == "old") + data$dose / 10
  steps_data(data, "patient", "severity", c("drug", "dose"), "y")
}

test_that("an action may have several parts, which rules and policies give and take", {
  steps <- drugs_and_doses()
  expect_equal(names(as.data.frame(steps))[4:5], c("action_drug", "action_dose"))
  expect_equal(steps_of(steps[1:8, ])$actions, data.frame(
    action_drug = rep(c("new", "old"), each = 2), action_dose = c(1, 5)
  ))
  expect_output(print(steps), "Actions: new, 1 25%; new, 5 25%; old, 1 25%; old, 5 25%")
  best <- data.frame(action_drug = c("old", "new"), action_dose = 5)
  here <- data.frame(severity = c("low", "high"))
  expect_equal(predict(learn_q(steps), here), best)
  # A formula may have the parts.
  by_parts <- learn_fitted_q(steps, ~ action_drug * severity + action_dose)
  expect_equal(predict(by_parts, here), best)
  expect_equal(predict(solve_mdp(estimate_model(steps)), "high"), best[2, ], ignore_attr = TRUE)
  chooses <- function(states) {
    data.frame(action_drug = ifelse(states$severity == "high", "new", "old"), action_dose = 5)
  }
  found <- evaluate_offline(steps, chooses, "is", behavior = policy_random(), replicates = 2,
                            seed = 1)
  expect_equal(found$estimates$estimate, 2)
  expect_error(
    evaluate_offline(steps, data.frame(action_drug = "new", action_dose = 7)), 'action "new, 7"'
  )
})
