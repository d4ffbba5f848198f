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
masked_env <- function(mask, name = "action_mask", actions = space_discrete(3)) {
  gym_env(
    reset = function(self) 0L,
    step = function(self, action) {
      list(observation = 1L, reward = action[[1]], terminated = FALSE,
           info = stats::setNames(list(mask(action)), name))
    },
    observation_space = space_discrete(2), action_space = actions,
    max_episode_steps = 3
  )
}

test_that("a mask has a number for each combination of an action's parts", {
  learned <- learn_q(
    masked_env(function(action) rbind(c(1, 1, 0), c(0, 1, 1)), actions = space_multi_discrete(2:3)),
    iterations = 3, seed = 1, mask = "action_mask", target = Inf, initial = 10, eval_episodes = 2
  )
  expect_identical(which(learned$policy$q[2, ] == -Inf), 3:4)
})

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

# Actions of several parts.

test_that("learners of values play actions of several parts, and their policies give these", {
  for (space in spaces_of_parts) {
    env <- env_of_parts(space)
    learned <- learn_q(env, iterations = 10, seed = 1, discount = 0.5, initial = 5)
    expect_identical(evaluate_policy(env, learned, episodes = 5, seed = 1)$mean_return, 8)
    expect_equal(unlist(act(learned$policy, 1)), c(1, 2), ignore_attr = TRUE)
    expect_equal(unlist(predict(learned, 0:1)), c(0, 1, 0, 2), ignore_attr = TRUE)
  }
  expect_named(act(learned$policy, 1), c("left", "right"))
  expect_named(state_values(learned, actions = TRUE),
               c("state", "action_left", "action_right", "value"))
  expect_identical(dim(predict(learned, 0:1, type = "probability")), c(2L, 6L))
})

test_that("each learner plays actions of several parts", {
  skip_unless_all()
  env <- env_of_parts(spaces_of_parts[[3]])
  learners <- list(
    learn_sarsa, learn_monte_carlo, learn_actor_critic,
    function(...) learn_q(..., double = TRUE), function(...) learn_q(..., planning = 2),
    function(...) learn_q(..., features = tile_coding(2)),
    function(...) learn_monte_carlo(..., importance = "weighted")
  )
  for (learn in learners) {
    learned <- learn(env, iterations = 20, seed = 1, discount = 0.5, initial = 5)
    expect_gt(evaluate_policy(env, learned, episodes = 20, seed = 1)$mean_return, 7)
  }
})

test_that("actions of several parts that a policy returns are judged by TD", {
  env <- env_of_parts(spaces_of_parts[[3]])
  judged <- function(policy) {
    state_values(learn_td(env, policy, iterations = 20, discount = 0.01, initial = 1, seed = 1))
  }
  best <- function(state) list(right = 2 * state, left = state)
  expect_equal(judged(best), c(`0` = 2, `1` = 2), tolerance = 0.1)
  expect_lt(max(judged(policy_random())), 1.5)
  expect_error(judged(function(state) list(left = state, right = 3 + state)), "right",
               class = "gym_error_space")
})

test_that("a learner plays actions of several parts on a server", {
  for (num_envs in 1:2) {
    env <- gym_make("odd_environments:Parts-v0", num_envs = num_envs, client = odd_server())
    learned <- learn_q(env, iterations = 10, seed = 1, discount = 0.5, initial = 5)
    expect_identical(evaluate_policy(env, learned, episodes = 5, seed = 1)$mean_return, 8)
    env$close()
  }
  # Its processes do not play such a table.
  learned <- learn_monte_carlo(
    "odd_environments:Parts-v0", iterations = 10, episodes = 10, seed = 1, discount = 0.5,
    initial = 5, client = odd_server()
  )
  expect_gt(learned$final$mean_return, 7)
})

test_that("actions without a column each are refused as states are", {
  refused <- function(space, text) {
    expect_error(learn_q(env_of_parts(space), iterations = 1), text, class = "gym_error_argument")
    expect_error(rollout(env_of_parts(space), policy_table(diag(2))), text)
  }
  refused(space_multi_discrete(rep(10, 8)), "100,000,000 columns; at most 10,000,000 are possible")
  refused(space_box(c(-1, -1), c(1, 1)), "needs actions that can be counted")
})
