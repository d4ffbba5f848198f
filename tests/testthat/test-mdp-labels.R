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
