# Which actions can be taken, as infos say.

# What Taxi's mask says, by its model: driving into a wall, and picking up or dropping where that
# cannot be done, is forbidden; these leave the state as it is.
effective <- function(model) {
  moves <- model$transitions
  matrix(moves$next_state != moves$state, nrow = length(model$start), byrow = TRUE)
}

test_that("what the info forbids is never taken, with one sub-environment and with several", {
  skip_unless_all()
  model <- env_model("Taxi-v4")
  learners <- list(
    function(...) learn_q(..., epsilon = 1), function(...) learn_q(..., double = TRUE),
    function(...) learn_sarsa(..., n = 3), function(...) learn_monte_carlo(...)
  )
  for (learn in learners) {
    for (num_envs in c(1, 3)) {
      learned <- learn(
        "Taxi-v4", iterations = 1, episodes = 3, seed = 1, mask = "action_mask", eval_episodes = 2,
        num_envs = num_envs, num_workers = 0, target = Inf
      )
      # Whoever picks up or drops where it cannot be done pays 10.
      expect_gte(min(learned$history$mean_return), -200)
      barred <- learned$policy$q == -Inf
      expect_gt(sum(barred), 20)
      expect_false(any(effective(model)[barred]))
      # A state's mask is noted as a whole.
      known <- rowSums(barred) > 0
      expect_identical(!barred[known, ], effective(model)[known, ])
    }
  }
})

test_that("a learner without a mask takes what is forbidden", {
  skip_unless_all()
  learned <- learn_q("Taxi-v4", iterations = 1, episodes = 1, epsilon = 1, seed = 1, target = Inf)
  expect_lt(min(learned$history$mean_return), -200)
})

# Two states; the info of each step has the mask that `mask` returns.
masked_env <- function(mask, name = "action_mask") {
  gym_env(
    reset = function(self) 0L,
    step = function(self, action) {
      list(observation = 1L, reward = action, terminated = FALSE,
           info = stats::setNames(list(mask(action)), name))
    },
    observation_space = space_discrete(2), action_space = space_discrete(3),
    max_episode_steps = 3
  )
}

test_that("the mask of an environment in R is taken", {
  learned <- learn_q(masked_env(function(action) c(TRUE, TRUE, FALSE)), iterations = 3, seed = 1,
                     mask = "action_mask", target = Inf, initial = 10, eval_episodes = 2)
  expect_identical(learned$policy$q[2, 3], -Inf)
  expect_true(all(is.finite(learned$policy$q[, 1:2])))
})

test_that("masks that forbid everything, do not fit or are not there are refused by name", {
  skip_unless_all()
  learn <- function(env, mask = "action_mask", ...) {
    learn_q(env, iterations = 1, seed = 1, mask = mask, eval_episodes = 2, target = Inf, ...)
  }
  nothing <- masked_env(function(action) c(0, 0, 0))
  expect_error(learn(nothing), "`action_mask` forbids every action at the observation 1",
               class = "gym_error_argument")
  short <- masked_env(function(action) c(1, 0))
  expect_error(learn(short), "must be a number or TRUE or FALSE for each of 3 actions",
               class = "gym_error_argument")
  expect_error(learn("Taxi-v4", "mask"), "no such element.*\"prob\", \"action_mask\"",
               class = "gym_error_argument")
  expect_error(learn(walk_model(), "mask"), "`mask` needs the infos of",
               class = "gym_error_argument")
  expect_error(agent_q(mask = 1), class = "gym_error_argument")
  expect_error(agent_sarsa(mask = "mask", features = tile_coding(2, 2)), "`mask` works",
               class = "gym_error_argument")
})
