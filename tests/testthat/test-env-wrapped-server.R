lean <- function(observation) as.integer(observation[, "pole_angle"] > 0)

shaped <- function(reward, observation, next_observation, terminated) {
  reward + observation[, 1] + 10 * next_observation[, 2] - 100 * terminated
}

# Both ways to play several sub-environments, and a single one.
test_that("rewards change as the function says, whatever plays", {
  test_client()
  swing <- function(observation) 2L * as.integer(observation[, 5] > 0)
  for (case in list(list("CartPole-v1", lean, NULL), list("CartPole-v1", lean, 1),
                    list("Acrobot-v1", swing, 8))) {
    play <- function(env) {
      as.data.frame(rollout(
        env, case[[2]], 20, seed = 1, steps = TRUE, next_observation = TRUE, max_steps = 300,
        num_envs = case[[3]]
      ))
    }
    plain <- play(case[[1]])
    played <- play(gym_wrap(case[[1]], "TransformReward", func = shaped))
    n <- (ncol(plain) - 6) / 2
    expect_equal(
      played$reward,
      plain$reward + plain[[3]] + 10 * plain[[ncol(plain) - n + 2]] - 100 * plain$terminated
    )
    expect_identical(replace(played, "reward", plain["reward"]), plain)
  }
})

test_that("observations and actions change, after the server's wrappers", {
  small <- "CartPole-v1" |>
    gym_wrap("TimeLimit", max_episode_steps = 5) |>
    gym_wrap("TransformObservation", func = function(observation) observation[, 3:4],
             observation_space = space_box(c(angle = -Inf, speed = -Inf), Inf))
  wrapped <- gym_wrap(small, "TransformAction", func = function(action, observation) {
    stopifnot(colnames(observation) == c("angle", "speed"))
    action > 0
  }, action_space = space_box(-1, 1))
  env <- local_env(wrapped, seed = 1)
  expect_named(env$reset(), c("angle", "speed"))
  expect_error(env$step("push left"), class = "gym_error_space")
  flip <- "CartPole-v1" |> gym_wrap("TransformAction", func = function(action) 1 - action)
  flipped <- local_env(flip)
  plain <- local_env("CartPole-v1")
  expect_identical(flipped$reset(seed = 3), plain$reset(seed = 3))
  expect_identical(flipped$step("push left"), plain$step("push right"))
  expect_output(print(env), "actions: +<Box float64 .1.>")
  expect_identical(env$spec$wrappers, c("TimeLimit", "TransformObservation", "TransformAction"))
  played <- rollout(small, function(o) o[, "angle"] > 0, 3, seed = 1, steps = TRUE)
  expect_identical(max(played$episodes$length), 5L)
  expect_named(played$steps[3:4], c("angle", "speed"))
  expect_match(format(small), "observation_space = <Box float64 [2]>", fixed = TRUE)
})

test_that("a step that only resets has no reward, and final observations change, too", {
  test_client()
  plus <- function(observation) observation + 1
  first <- list(list("TransformReward", func = function(r) r + 7),
                list("TransformObservation", func = plus,
                     observation_space = space_box(-Inf, Inf, shape = 4)))
  for (mode in c("NextStep", "SameStep")) {
    make <- function(wrappers) {
      local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync", autoreset_mode = mode,
                wrappers = wrappers, frame = parent.frame(2))
    }
    plain <- make(list())
    env <- make(first)
    expect_equal(unname(env$reset(seed = 1:3)), unname(plain$reset(seed = 1:3)) + 1)
    before <- logical(3)
    resets <- 0
    for (step in 1:12) {
      out <- env$step(rep(1, 3))
      bare <- plain$step(rep(1, 3))
      expect_equal(out$reward, bare$reward + ifelse(before, 0, 7))
      expect_equal(unname(out$observation), unname(bare$observation) + 1)
      expect_equal(unname(out$next_observation), unname(bare$next_observation) + 1)
      expect_equal(lapply(out$info$final_obs, unname),
                   lapply(bare$info$final_obs, function(x) if (!is.null(x)) unname(x) + 1))
      resets <- resets + sum(before)
      before <- mode == "NextStep" & bare$done
    }
    expect_identical(resets > 0, mode == "NextStep")
    some <- env$reset(seed = c(NA, 5, NA), mask = c(FALSE, TRUE, FALSE))
    expect_equal(dim(some), c(3, 4))
  }
})

test_that("an environment that was made is wrapped, and remains the same instance", {
  env <- local_env("CartPole-v1", seed = 1)
  wrapped <- gym_wrap(env, "TransformReward", func = function(reward, observation) {
    reward + observation[, "cart_position"]
  })
  env$reset()
  expect_error(wrapped$step(1), "has not been reset", class = "gym_error_argument")
  first <- wrapped$reset(seed = 1, return_info = TRUE)
  expect_named(first, c("observation", "info"))
  expect_equal(wrapped$step(1)$reward, 1 + first$observation[[1]])
  expect_error(gym_wrap(env, "TimeLimit", max_episode_steps = 3), "The server applies TimeLimit")
  expect_identical(wrapped$instance_id, env$instance_id)
  wrapped$close()
  expect_false(env$is_open)
  expect_error(wrapped$step(1), "was closed")
})

test_that("a wrapper of the server's over one in R is refused, and so are calls that know none", {
  client <- test_client()
  wrapped <- gym_wrap("CartPole-v1", "TransformReward", func = function(r) r)
  late <- "TimeLimit runs on the server, so it must be inside TransformReward"
  expect_error(gym_wrap(wrapped, "TimeLimit", max_episode_steps = 3), late,
               class = "gym_error_argument")
  expect_error(gym_make(wrapped, wrappers = list(list("TimeLimit", max_episode_steps = 3))), late)
  expect_error(env_create(client, wrapped), "calls an R function", class = "gym_error_argument")
  expect_error(gym_wrap("CartPole-v1", "TransformReward", func = function(obs) 1), "needs `obs`")
  expect_error(gym_wrap("CartPole-v1", "TransformReward", f = sqrt), "has no argument `f`")
  expect_error(gym_wrap("CartPole-v1", "TransformReward", function(r) r), "as `func = function")
  expect_error(gym_wrap("CartPole-v1", "RewardWrapper", func = function(r) r),
               "does not take an R function", class = "gym_error_argument")
  lake <- gym_wrap("FrozenLake-v1", "TransformReward", func = function(r) r)
  expect_error(env_model(lake), class = "gym_error_no_model")
  bad <- gym_wrap("CartPole-v1", "TransformReward", func = function(r) r[-1])
  expect_error(rollout(bad, lean, 3, seed = 1), "`func` of TransformReward must return a finite")
  env <- local_env(gym_wrap("CartPole-v1", "TransformReward", func = function(r, at = 1) {
    if (fails) stop("oops") else r
  }), seed = 1)
  env$reset()
  fails <- TRUE
  expect_error(env$step(1), "raised an error", class = "gym_error_environment")
  fails <- FALSE
  expect_identical(env$step(1)$reward, 1)
})

test_that("every kind of agent learns with the rewards of a function", {
  skip_unless_all()
  test_client()
  minus <- "CartPole-v1" |> gym_wrap("TransformReward", func = function(reward) reward - 3)
  trained <- list(
    search_random(minus, rounds = 3, episodes = 2, seed = 1),
    search_cem(minus, policy_linear(), iterations = 1, eval_episodes = 2, seed = 1),
    search_ars(minus, iterations = 1, eval_episodes = 2, seed = 1),
    learn_ppo(minus, iterations = 1, episodes = 2, eval_episodes = 2, seed = 1),
    learn_reinforce(minus, iterations = 1, episodes = 2, eval_episodes = 2, seed = 1),
    learn_dqn(minus, iterations = 1, episodes = 2, eval_episodes = 2, seed = 1)
  )
  for (training in trained) {
    expect_lt(mean(training$episodes$return %||% training$final$mean_return), 0)
    expect_null(training$target)
  }
  lake <- "FrozenLake-v1" |> gym_wrap("TransformReward", func = function(reward) reward - 1)
  for (learn in list(learn_q, learn_sarsa, learn_monte_carlo, learn_actor_critic)) {
    expect_no_message(
      training <- learn(lake, iterations = 1, episodes = 3, eval_episodes = 2, seed = 1),
      class = "gym_message_model"
    )
    expect_lt(training$final$mean_return, 0)
  }
  # What a learner of tables is evaluated by are its own rewards, too.
  expect_gte(evaluate_policy("FrozenLake-v1", training, episodes = 5)$mean_return, 0)
  file <- withr::local_tempfile()
  saveRDS(list(lake, training), file)
  loaded <- readRDS(file)
  play <- function(env, policy) rollout(env, policy, 5, seed = 1)$episodes
  expect_identical(play(loaded[[1]], loaded[[2]]), play(lake, training))
  taxi <- "Taxi-v4" |> gym_wrap("TransformReward", func = function(reward) reward / 10)
  masked <- learn_q(taxi, mask = "action_mask", iterations = 1, episodes = 3, eval_episodes = 2,
                    seed = 1)
  expect_true(any(is.infinite(masked$policy$q)))
  checkpoint <- withr::local_tempfile(fileext = ".rds")
  run <- function(n, ...) {
    suppressMessages(search_cem(
      minus, policy_linear(), iterations = n, episodes = 1, eval_episodes = 2, seed = 1, ...
    ))
  }
  run(1, checkpoint = checkpoint)
  expect_identical(coef(run(2, checkpoint = checkpoint)), coef(run(2)))
})

test_that("workers play with the function", {
  skip_unless_all()
  skip_if_not_installed("future")
  test_client()
  wrapped <- "Acrobot-v1" |> gym_wrap("TransformReward", func = function(reward) reward / 2)
  play <- function() rollout(wrapped, policy_random(), 40, max_steps = 20, seed = 1)$episodes
  here <- play()
  withr::local_options(future.globals.onReference = "ignore")
  future::plan(future::multisession, workers = 2)
  withr::defer(future::plan(future::sequential))
  expect_identical(play(), here)
  connection <- file(tempfile(), "w")
  withr::defer(close(connection))
  attr(wrapped$wrappers[[1]]$func, "log") <- connection
  expect_message(play(), "the function of a wrapper has a connection")
})

test_that("it is said once that R plays step by step", {
  test_client()
  rlang::reset_message_verbosity("gym_calls_r")
  wrapped <- gym_wrap("CartPole-v1", "TransformReward", func = function(r) r)
  expect_message(rollout(wrapped, lean, seed = 1), "calls an R function in each step",
                 class = "gym_message_calls_r")
  expect_no_message(rollout(wrapped, lean, seed = 1))
  expect_identical(nrow(check_env(wrapped)), 0L)
  drawn <- rollout(wrapped, lean, seed = 1, max_steps = 2, frames = TRUE)
  expect_length(drawn$frames[[1]], 3)
})

test_that("a misspelt wrapper for functions is named", {
  expect_error(gym_wrap("CartPole-v1", "TransformRewards", func = identity),
               "Did you mean TransformReward", class = "gym_error_argument")
})

test_that("prints name the wrappers, which are part of every return", {
  shaped <- gym_wrap("CartPole-v1", "TransformReward", func = function(reward) 2 * reward)
  client <- test_client()
  text <- "CartPole-v1 |> TransformReward"
  played <- rollout(shaped, policy_random(), episodes = 2, seed = 1, client = client)
  trained <- train_agent(agent_ars(), shaped, iterations = 1, max_steps = 5, eval_episodes = 2,
                         target = Inf, seed = 1, client = client)
  evaluated <- evaluate_policy(shaped, policy_random(), episodes = 2, seed = 1, client = client)
  made <- gym_make(shaped, client = client)
  for (x in list(played, summary(played), trained, evaluated, made)) {
    expect_output(print(x), text, fixed = TRUE)
  }
  made$close()
  expect_match(ggplot2::autoplot(trained)$labels$title, "TransformReward")
})
