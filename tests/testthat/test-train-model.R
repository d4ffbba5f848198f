# Learners that name an environment by its id, and sample from its model in R.

learn <- function(env, ..., seed = 1) {
  learn_q(env, iterations = 2, episodes = 2, seed = seed, eval_episodes = 2, target = Inf, ...,
          client = test_client())
}

# Whether it learned from the model: what it says, and how it was played.
from_model <- function(...) {
  said <- FALSE
  learned <- withCallingHandlers(
    learn(...),
    gym_message_model = function(cnd) {
      said <<- TRUE
      expect_match(conditionMessage(cnd), "`model = FALSE` plays on the server", fixed = TRUE)
      rlang::cnd_muffle(cnd)
    }
  )
  expect_identical(learned$provenance$way == "from the model in R", said)
  said
}

test_that("an id with a model is learned from the model, unless the environment is needed", {
  expect_true(from_model("FrozenLake-v1", is_slippery = FALSE))
  expect_true(from_model("Taxi-v4", num_envs = 3))
  expect_true(from_model("CliffWalking-v1", max_steps = 50))
  expect_false(from_model("FrozenLake-v1", model = FALSE))
  expect_false(from_model("Taxi-v4", mask = "action_mask"))
  expect_false(from_model("Taxi-v4", fickle_passenger = TRUE))
  expect_false(from_model("FrozenLake-v1", callback = function(training) TRUE))
  expect_false(from_model("FrozenLake-v1", desc = NULL, map_name = NULL))
  expect_false(from_model("FrozenLake-v1", num_workers = 0))
  expect_false(from_model("FrozenLake-v1", render_mode = "rgb_array"))
  expect_false(from_model(gym_wrap("FrozenLake-v1", "TimeLimit", max_episode_steps = 20)))
})

test_that("a model without a limit asks for one", {
  # Without the preset of learn_q(), which has a limit.
  expect_error(train_agent(agent_q(), "CliffWalking-v1", iterations = 2, client = test_client()),
               "Give `max_steps`", class = "gym_error_argument")
  expect_false(from_model("CliffWalking-v1", model = FALSE))
})

# Plays a model at random in the learners' loop: the steps, and the returns of episodes.
played_from_model <- function(model, episodes, limit) {
  draws <- uniform_draws()
  actions <- as.integer(model$action_space$n)
  steps <- list()
  act <- function() as.integer(draws$draw() * actions) + 1L
  learner <- list(
    act = function(x, sub_env, observation) act(),
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      steps[[length(steps) + 1L]] <<- c(x, column, after, reward, terminated)
      act()
    }
  )
  world <- world_of(list(model = model), list(), draws$draw)
  played <- withr::with_seed(3, play_steps(
    learner, world, seq_len(episodes), limit, function(ended) NULL, NULL
  ))
  steps <- do.call(rbind, steps)
  steps[, 1:3] <- steps[, 1:3] - 1
  list(steps = steps, returns = played$returns)
}

test_that("the model moves as the server does, by a chi-squared test in each state and action", {
  skip_unless_all()
  for (id in c("FrozenLake-v1", "CliffWalking-v1", "Taxi-v4")) {
    model <- env_model(id, client = test_client())
    here <- played_from_model(model, 300, 100)
    there <- rollout(id, policy_random(), episodes = 300, max_steps = 100, seed = 7, steps = TRUE,
                     next_observation = TRUE, client = test_client())
    after <- grep("^next_", names(there$steps), value = TRUE)
    columns <- c(sub("^next_", "", after), "action", after, "reward", "terminated")
    all <- rbind(here$steps, as.matrix(there$steps[columns]) + 0)
    pair <- paste(all[, 1], all[, 2])
    outcome <- paste(all[, 3], all[, 4], all[, 5])
    side <- rep(c("model", "server"), c(nrow(here$steps), nrow(there$steps)))
    p_value <- vapply(split(data.frame(side, outcome), pair), function(one) {
      counts <- table(one$side, one$outcome)
      if (nrow(counts) < 2L) return(NA_real_)
      if (ncol(counts) < 2L) 1 else suppressWarnings(stats::chisq.test(counts)$p.value)
    }, 0)
    expect_gt(sum(!is.na(p_value)), 40)
    expect_gt(min(p_value, na.rm = TRUE), 1e-3 / length(p_value))
    # The mean return of the random policy against its exact value.
    exact <- evaluate_policy(model, policy_random(), max_steps = 100)$mean_return
    for (returns in list(here$returns, there$episodes$return)) {
      expect_lt(abs(mean(returns) - exact), 4 * stats::sd(returns) / sqrt(300))
    }
  }
})
