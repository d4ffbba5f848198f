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

# Names of states and actions ------------------------------------------------------------

care <- function() {
  gym_model(data.frame(
    state = c("low", "low", "low", "high", "high"),
    action = c("wait", "treat", "treat", "treat", "wait"),
    next_state = c("high", "low", "cured", "low", "dead"),
    probability = c(1, 0.5, 0.5, 1, 1), reward = c(-1, 0, 5, -2, -10)
  ), start = "low", id = "Care")
}

# A grid of two rows and three columns, whose last column ends the episode.
named_grid <- function() {
  moves <- expand.grid(row = 1:2, column = 1:2, action = c("left", "right"))
  moves$next_row <- moves$row
  moves$next_column <- pmax(moves$column + ifelse(moves$action == "left", -1L, 1L), 1L)
  moves$reward <- -1
  gym_model(moves, state = c("row", "column"), max_episode_steps = 20)
}

test_that("names of states and actions go from the model to its solution", {
  model <- care()
  expect_equal(names(model$start), c("cured", "dead", "high", "low"))
  expect_equal(as.data.frame(model)$next_state, c("low", "dead", "low", "cured", "high"))
  solved <- solve_mdp(model)
  expect_equal(solved$values[c("low", "high")], c(low = 5, high = 3))
  expect_equal(colnames(solved$q), c("treat", "wait"))
  expect_equal(as.data.frame(solved)$action, c(NA, NA, "treat", "treat"))
  expect_equal(predict(solved, c("low", "high")), c("treat", "treat"))
  expect_error(predict(solved, "lo"), "Did you mean \"low\"")
  by_name <- c(low = "wait", high = "wait", cured = "wait", dead = "wait")
  expect_equal(solve_mdp(model, by_name)$values[["low"]], -11)
})

test_that("levels of factors give the order", {
  table <- as.data.frame(care())
  table$action <- factor(table$action, c("wait", "treat"))
  expect_equal(colnames(solve_mdp(gym_model(table))$q), c("wait", "treat"))
})

test_that("learners, rollouts and models of steps keep the names", {
  learned <- learn_q(care(), iterations = 20, seed = 1)
  expect_named(state_values(learned), c("cured", "dead", "high", "low"))
  expect_equal(predict(learned$policy, "low"), "treat")
  expect_setequal(state_values(learned, actions = TRUE)$action, c("wait", "treat"))
  played <- rollout(care(), policy_random(), episodes = 200, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  expect_setequal(played$steps$state, c("low", "high"))
  for (estimated in list(estimate_model(played), estimate_model(steps_data(played)))) {
    expect_equal(solve_mdp(estimated)$values[["low"]], 5)
    row <- as.data.frame(estimated)[2, c("state", "action", "next_state")]
    expect_equal(vapply(row, as.character, ""),
                 c(state = "high", action = "wait", next_state = "dead"))
  }
})

test_that("a state of several columns has them everywhere", {
  model <- named_grid()
  solved <- as.data.frame(solve_mdp(model))
  expect_equal(solved$value, c(-2, -1, 0, -2, -1, 0))
  expect_named(solved, c("row", "column", "value", "action"))
  expect_equal(as.character(predict(solve_mdp(model), data.frame(row = 2, column = 1))), "right")
  learned <- learn_q(model, iterations = 10, seed = 1)
  expect_named(state_values(learned), c("row", "column", "value"))
  played <- rollout(model, policy_random(), episodes = 50, seed = 1, steps = TRUE,
                    next_observation = TRUE)
  expect_true(all(c("row", "next_column") %in% names(played$steps)))
  expect_equal(rollout(model, learn_q(played), episodes = 5, seed = 1)$episodes$return,
               rollout(model, solve_mdp(model)$policy, episodes = 5, seed = 1)$episodes$return)
})

test_that("errors about named models name states and actions", {
  table <- as.data.frame(care())
  table$probability[[3]] <- 0.4
  expect_error(gym_model(table), "probabilities of action treat in state low add up to 0.9")
  expect_error(gym_model(as.data.frame(care()), start = "well"), "There is no state \"well\"")
})

test_that("pictures have the names of states", {
  data <- ggplot2::ggplot_build(ggplot2::autoplot(solve_mdp(care())))
  expect_equal(data$layout$panel_params[[1]]$x$get_labels(), c("cured", "dead", "high", "low"))
  grid <- ggplot2::ggplot_build(ggplot2::autoplot(solve_mdp(named_grid())))
  expect_equal(grid$layout$panel_params[[1]]$x$get_labels(), c("1", "2", "3"))
})

test_that("observations of several parts are states of an estimated model, and its policy plays", {
  # Row and column; the end is in the corner.
  walk <- function(space, observe) {
    gym_env(
      reset = function(self) {
        self$at <- c(0L, 0L)
        observe(self$at)
      },
      step = function(self, action) {
        self$at[[action + 1L]] <- min(self$at[[action + 1L]] + 1L, 1L)
        list(observation = observe(self$at), reward = -1, terminated = all(self$at == 1L))
      },
      observation_space = space, action_space = space_discrete(2), max_episode_steps = 20
    )
  }
  both <- list(space_discrete(2), space_discrete(2))
  envs <- list(
    walk(space_dict(row = both[[1L]], column = both[[2L]]),
         function(at) list(row = at[[1L]], column = at[[2L]])),
    walk(do.call(space_tuple, both), as.list),
    # One state of six is never seen.
    walk(space_multi_discrete(c(2, 3)), identity)
  )
  for (env in envs) {
    played <- rollout(env, policy_random(), episodes = 30, seed = 1, steps = TRUE,
                      next_observation = TRUE)
    solved <- solve_mdp(suppressMessages(estimate_model(played)))
    expect_equal(solved$start_value, -2)
    expect_equal(rollout(env, solved$policy, episodes = 1)$episodes$return, -2)
  }
})

test_that("the actions of a model may have several columns", {
  treated <- gym_model(data.frame(
    state = "ill", drug = c("a", "b"), dose = c(1, 1, 2, 2), next_state = "well",
    reward = c(1, 0, 2, 5)
  ), action = c("drug", "dose"))
  best <- data.frame(action_drug = "b", action_dose = 2)
  solved <- solve_mdp(treated)
  expect_equal(predict(solved, "ill"), best)
  expect_equal(as.data.frame(solved)[1, 3:4], best)
  expect_equal(colnames(solved$q), c("a, 1", "a, 2", "b, 1", "b, 2"))
  expect_equal(names(as.data.frame(treated))[1:4],
               c("state", "action_drug", "action_dose", "next_state"))
  played <- rollout(treated, solved$policy, episodes = 1, seed = 1, steps = TRUE)$steps
  expect_equal(played[names(best)], best)
  expect_equal(state_values(learn_q(treated, iterations = 1, seed = 1), TRUE)[4, 2:3], best,
               ignore_attr = TRUE)
})
