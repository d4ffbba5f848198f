skip_unless_sb3 <- function() {
  skip_unless_all()
  skip_if_not(has_sb3(), "Stable-Baselines3 is not installed")
}

# Small networks and few episodes: a training of seconds.
learn_quickly <- function(algorithm = "SAC", env = "Pendulum-v1", total_steps = 300, ...,
                          eval_every = 1e6, eval_episodes_curve = 1, eval_episodes = 2) {
  suppressMessages(learn_sb3(
    algorithm, env, total_steps, ..., policy_kwargs = list(net_arch = 8), eval_every = eval_every,
    eval_episodes_curve = eval_episodes_curve, eval_episodes = eval_episodes, device = "cpu"
  ), classes = "gym_message_preset")
}

test_that("a training by Stable-Baselines3 is a training", {
  skip_unless_sb3()
  log <- withr::local_tempdir()
  learn <- function(...) learn_quickly(..., eval_every = 150, num_envs = 2, normalize = TRUE)
  both <- learn(seeds = 1:2, log = log)
  expect_s3_class(both, "gym_trainings")
  expect_identical(as.data.frame(both)$seed, 1:2)
  trained <- both$trainings[["1"]]
  expect_s3_class(trained, "gym_training")
  expect_identical(trained$steps, 300)
  expect_identical(trained$policy$sizes, c(3L, 8L, 1L))
  expect_false(is.null(trained$policy$moments$mean))
  expect_identical(tail(trained$history$steps, 1), 300)
  expect_identical(trained$evaluations$kind[1], "curve")
  expect_identical(tail(trained$evaluations$kind, 1), "final")
  expect_true(all(c("actor_loss", "critic_loss") %in% names(trained$history)))
  expect_length(predict(trained, c(1, 0, 0)), 1)
  expect_match(format(trained$agent), "SAC of Stable-Baselines3: learning_rate 0.001", fixed = TRUE)
  expect_output(print(trained), "SAC of Stable-Baselines3")
  expect_s3_class(ggplot2::autoplot(trained), "ggplot")
  expect_s3_class(ggplot2::autoplot(trained, type = "diagnostics"), "ggplot")
  # The log has 15 digits.
  expect_equal(
    learning_curves(log)$mean_return, learning_curves(both)$mean_return, tolerance = 1e-14
  )
  expect_match(provenance(trained)$way, "Stable-Baselines3 on cpu")
  expect_true("torch" %in% names(provenance(trained)$server))
  expect_false(identical(coef(both$trainings[["2"]]), coef(trained)))
})

test_that("a checkpoint goes on with the remaining steps", {
  skip_unless_sb3()
  folder <- withr::local_tempdir()
  # Stable-Baselines3 saves no model where it finds a folder of this name.
  withr::local_dir(withr::local_tempdir())
  dir.create("gym")
  learn <- function(...) learn_quickly("DQN", "CartPole-v1", ..., seed = 1, checkpoint = folder)
  begun <- learn(200)
  expect_message(trained <- learn(400), class = "gym_message_resumed")
  expect_gte(trained$steps, 400)
  expect_identical(trained$history$iteration, seq_len(nrow(trained$history)))
  expect_false(is.unsorted(trained$history$steps))
  expect_identical(trained$history$steps[seq_len(nrow(begun$history))], begun$history$steps)
  expect_error(
    learn(400, gamma = 0.9), "another value of `arguments`", class = "gym_error_checkpoint"
  )
})

test_that("a checkpoint that is damaged is named, with the fix", {
  folder <- withr::local_tempdir()
  dir.create(file.path(folder, "checkpoint"))
  writeLines("{\"num_time", file.path(folder, "checkpoint", "state.json"))
  expect_error(
    sb3_state(folder), "state.json is no JSON document.*resume = FALSE",
    class = "gym_error_checkpoint"
  )
})

test_that("an interrupt keeps the policy, and a killed session leaves no child", {
  skip_unless_sb3()
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  code <- bquote({
    trained <- gym::learn_sb3(
      "PPO", "CartPole-v1", 1e5, eval_episodes = 2, checkpoint = .(folder), device = "cpu"
    )
    saveRDS(trained, file.path(.(folder), "trained.rds"))
  })
  start <- function() {
    unlink(file.path(folder, "progress.csv"))
    process <- with_own_tree_id(processx::process$new(
      file.path(R.home("bin"), "Rscript"), c("--no-init-file", "-e", deparse1(code, "\n"))
    ))
    wait_until(function() isTRUE(file.size(file.path(folder, "progress.csv")) > 0))
    process
  }
  process <- start()
  process$interrupt()
  await_end(process, 120)
  trained <- readRDS(file.path(folder, "trained.rds"))
  expect_true(trained$interrupted)
  expect_gt(trained$steps, 0)
  process <- start()
  result <- file.path(folder, "result.json")
  expect_false(file.exists(result))
  process$kill()
  # The child sees the end of its input, and writes its result.
  expect_true(wait_until(function() file.exists(result)))
})

test_that("an error during training has the training with finite weights", {
  skip_unless_sb3()
  cnd <- tryCatch(
    learn_quickly("PPO", total_steps = 4000, learning_rate = 1e30, n_steps = 64, batch_size = 64),
    gym_error_training = identity
  )
  expect_match(conditionMessage(cnd$parent), "NaN")
  expect_true(all(is.finite(coef(cnd$result))))
  expect_null(cnd$result$final)
})

test_that("an environment of R is refused, and wrong names get the right ones", {
  expect_error(learn_sb3("SAC", 3, 100), "`learn_ppo\\(\\)`", class = "gym_error_argument")
  expect_error(learn_sb3("SAC", "Pendulum-v1", 0), "total_steps", class = "gym_error_argument")
  error <- list(
    message = "SAC has no argument `gama`.", argument = "gama", known = c("gamma", "tau")
  )
  cnd <- sb3_error(error, NULL)
  expect_s3_class(cnd, "gym_error_argument")
  expect_match(conditionMessage(cnd), "Did you mean `gamma`?", fixed = TRUE)
})
