test_that("a policy for pictures plays whole games in its own process, and is kept as data", {
  skip_unless_all()
  skip_if_not(has_sb3(), "Stable-Baselines3 is not installed")
  skip_if_not(isTRUE(env_registry(test_client(), "ALE/Pong-v5")$available[1]), "the extra atari")
  short <- list(max_num_frames_per_episode = 80)
  trained <- suppressMessages(learn_sb3(
    "PPO", "ALE/Pong-v5", 64, policy = "CnnPolicy", n_steps = 32, batch_size = 32, n_epochs = 1,
    env_kwargs = short, seed = 1, eval_episodes_curve = 0, eval_episodes = 2, device = "cpu"
  ))
  expect_s3_class(trained$policy, "gym_policy_sb3")
  expect_output(print(trained), "Policy: CnnPolicy of PPO, by Stable-Baselines3", fixed = TRUE)
  settings <- trained$agent$preprocessing
  expect_identical(settings$repeat_action_probability, 0.25)
  expect_identical(c(settings$frame_skip, settings$frame_stack), c(4L, 4L))
  expect_true(settings$clip_reward && settings$terminal_on_life_loss)
  expect_identical(trained$final$episodes, 2L)

  # The same seed is the same game, also after the policy was in a file.
  file <- withr::local_tempfile()
  saveRDS(trained, file)
  trained <- readRDS(file)
  played <- rollout(
    "ALE/Pong-v5", trained, 2, seed = 3, max_num_frames_per_episode = 80, frames = TRUE,
    steps = TRUE
  )
  expect_identical(lengths(unclass(played$frames)), played$episodes$length + 1L)
  expect_true(all(played$episodes$truncated))
  expect_match(provenance(played)$way, "process of its own")
  steps <- played$steps
  expect_identical(nrow(steps), sum(played$episodes$length))
  seen <- as.matrix(steps[grep("^obs_", names(steps))])
  pictures <- aperm(array(t(seen), c(84, 84, 4, nrow(seen))), 4:1)
  expect_identical(predict(trained, pictures), steps$action)

  # An interrupt keeps the games that are over.
  local_functions(progress_bar = function(...) function(...) rlang::interrupt())
  expect_message(
    short <- rollout("ALE/Pong-v5", trained, 1000, seed = 3, max_num_frames_per_episode = 80),
    class = "gym_message_interrupted"
  )
  expect_true(short$interrupted)
  expect_true(nrow(short$episodes) %in% 1:999)
})

test_that("environments that Python cannot make, and policies that R asks, are refused", {
  policy <- new_sb3_policy(raw(), list(algorithm = "PPO", policy = "CnnPolicy"))
  expect_error(act(policy, 1), "does not know the observations", class = "gym_error_argument")
  expect_error(
    policy_bind(policy, list(made_of = list(env = 3))), "Give the environment's id",
    class = "gym_error_argument"
  )
  both <- policy_list(list(policy, policy_random()))
  expect_true(plays_apart(both))
  expect_error(
    check_plays_apart(policy_random(), list()), "Play each in a call of its own",
    class = "gym_error_argument"
  )
})
