test_that("an environment is an object with Gymnasium's names", {
  env <- local_env("CartPole-v1", seed = 1)
  expect_output(print(env), "<gym_env: CartPole-v1>.*<Box float32 \\[4\\]>.*<Discrete 2>")
  expect_equal(env$spec$reward_threshold, 475)
  expect_equal(env$spec$max_episode_steps, 500)
  expect_length(env$reset(), 4)
  expect_identical(env$step(1)$truncated, FALSE)
  # The classic calls see the same environment.
  out <- env_step(env$client, env$instance_id, 0)
  expect_equal(out$reward, 1)
  expect_true(env$is_open)
  env$close()
  expect_false(env$is_open)
  expect_output(print(env), "closed")
  expect_error(env$close(), NA)
  gone <- local_env()
  env_close(gone$client, gone$instance_id)
  expect_error(gone$close(), NA)
  expect_error(env$step(1), "was closed", class = "gym_error_argument")
  expect_error(env$reset(), "was closed", class = "gym_error_argument")
})

test_that("arguments by name go to the environment", {
  env <- local_env("CartPole-v1", sutton_barto_reward = TRUE)
  env$reset()
  expect_equal(env$step(1)$reward, 0)
  expect_error(local_env("CartPole-v1", wind = 3), "wind", class = "gym_error_http_400")
  expect_error(gym_make("CartPole-v1", 3), class = "gym_error_argument")
  expect_error(gym_make("CartPole-v1", gravity = 1, gravity = 2), "more than once",
               class = "gym_error_argument")
})

test_that("an environment that was thrown away is closed by the next that is made", {
  client <- create_GymClient(test_client()$remote_base)
  before <- length(env_list_all(client))
  env <- gym_make("CartPole-v1", client = client)
  rm(env)
  gc()
  env <- local_env(client = client)
  expect_length(env_list_all(client), before + 1)
})

test_that("set.seed() fixes an environment that is given no seed, by the one number it draws", {
  first <- function(...) {
    env <- local_env("CartPole-v1", ...)
    list(env$reset(), env$step(1)$observation, env$reset())
  }
  set.seed(1)
  drawn <- first()
  state <- .Random.seed
  expect_identical(first(seed = 5), first(seed = 5))
  expect_identical(.Random.seed, state)
  set.seed(1)
  seed <- draw_seed()
  expect_identical(.Random.seed, state)
  expect_identical(first(seed = seed), drawn)
  expect_false(identical(first(), drawn))
})

test_that("Gymnasium's warnings come once, as warnings", {
  client <- test_client()
  make <- function() {
    gym_make("LunarLander-v3", enable_wind = TRUE, wind_power = 29, client = client)$close()
  }
  warned <- expect_warning(make(), "^wind_power value .* 29", class = "gym_warning_gymnasium")
  expect_no_match(conditionMessage(warned), "\033", fixed = TRUE)
  expect_no_warning(make())
  expect_warning(
    rollout("Acrobot", policy_random(), seed = 1, max_steps = 1, client = client),
    "latest versioned environment `Acrobot-v1`", class = "gym_warning_gymnasium"
  )
})

test_that("what cannot be made gives the reason of the registry", {
  client <- test_client()
  listed <- env_registry(client, "Pusher-v4")
  skip_if(listed$available)
  expect_error(gym_make("Pusher-v4", client = client), listed$reason, fixed = TRUE)
})

test_that("print() and summary() of an environment say what there is to know", {
  env <- local_env("CartPole-v1")
  expect_output(print(env), "observations: <Box float32 .4.>: `cart_position`, `cart_velocity`, ")
  expect_identical(summary(env), env)
})

test_that("an argument that nobody has is explained with those of the function that was called", {
  client <- test_client()
  refused <- function(code, words) expect_error(code, words, class = "gym_error_http_400")
  refused(learn_ppo("CartPole-v1", lr = 1e-3, total_steps = 100, client = client),
          "Neither `learn_ppo.*Did you mean `learning_rate`")
  refused(learn_q("Taxi-v4", alpha = 0.1, total_steps = 10, client = client),
          "Did you mean `learning_rate`")
  refused(rollout("CartPole-v1", policy_random(), n = 3, client = client),
          "Neither `rollout.*Did you mean `episodes`")
  refused(learn_ppo("CartPole-v1", wombat = 1, total_steps = 100, client = client),
          "`learn_ppo\\(\\)` has `policy`, `batch_steps`")
  expect_error(learn_ppo("CartPole-v1", lr = 1e-3, client = client), "mean `learning_rate`")
  expect_error(rollout(fake_environment(), policy_random(), n = 3), "mean `episodes`")
})
