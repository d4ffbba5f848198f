quiet_trainings <- function(..., seeds = 1:2) {
  suppressMessages(train_agent(
    agent_ars(3, 2), fake_environment(reward = first_action), iterations = 4, seeds = seeds,
    target = Inf, eval_every = 2, eval_episodes = 4, max_steps = 3, ...
  ))
}

test_that("all evaluations of all trainings and seeds are one table", {
  ars <- quiet_trainings()
  curves <- learning_curves(ars, one = ars$trainings[["2"]])
  expect_identical(names(curves), c("training", names(no_curve)))
  expect_identical(unique(curves$training), c("ars", "one"))
  one <- ars$trainings[["2"]]
  of_one <- curves[curves$training == "one", ]
  expect_identical(of_one$mean_return, one$evaluations$mean_return)
  expect_identical(of_one$steps, evaluation_steps(one))
  expect_identical(of_one$kind, c("curve", "curve", "curve", "final"))
  expect_identical(unique(of_one$seed), 2)
  expect_identical(curves[curves$training == "ars" & curves$seed == 2, -1], of_one[-1],
                   ignore_attr = TRUE)
  expect_identical(nrow(learning_curves()), 0L)
  none <- one
  none$evaluations <- no_evaluations
  expect_identical(nrow(learning_curves(none)), 0L)
})

test_that("a log has the same evaluations as the result", {
  folder <- withr::local_tempdir()
  ars <- quiet_trainings(log = folder)
  curves <- learning_curves(ars, log = folder)
  log <- curves[curves$training == "log", -1]
  expect_equal(log, curves[curves$training == "ars", -1], ignore_attr = TRUE)
  expect_identical(unique(learning_curves(file.path(folder, "seed-2"))$seed), 2)
  # Also where the training went on, and where another began.
  path <- local_checkpoint()
  again <- withr::local_tempdir()
  for (iterations in c(1, 4)) {
    one <- suppressMessages(train_agent(
      agent_ars(3, 2), fake_environment(reward = first_action), iterations = iterations, seed = 2,
      target = Inf, eval_every = 2, eval_episodes = 4, max_steps = 3, log = again,
      checkpoint = path
    ))
  }
  expect_equal(learning_curves(one)[-1], learning_curves(again)[-1])
  quiet_trainings(log = folder, seeds = 1)
  expect_true(file.exists(file.path(folder, "seed-1", "evaluations-1.csv")))
})

test_that("a table with curves is refused with the function that makes it", {
  ars <- quiet_trainings()
  expect_error(as.data.frame(ars, curve = TRUE), "learning_curves", class = "gym_error_argument")
  expect_error(as.data.frame(ars$trainings[[1]], curve = TRUE), "learning_curves",
               class = "gym_error_argument")
})

test_that("logs of Stable-Baselines3 are read", {
  folder <- withr::local_tempdir()
  inside <- function(...) file.path(folder, ...)
  dir.create(inside("ppo-seed3"))
  # Rows of the evaluation callback have no rollout.
  writeLines(c(
    "eval/mean_reward,eval/mean_ep_length,time/total_timesteps,rollout/ep_rew_mean",
    "20.5,20,1000,", ",,2048,33", "60,60,2000,"
  ), inside("ppo-seed3", "progress.csv"))
  curves <- learning_curves(PPO = inside("ppo-seed3"))
  expect_identical(curves$steps, c(1000, 2000))
  expect_identical(curves$mean_return, c(20.5, 60))
  expect_identical(curves$kind, c("curve", "curve"))
  expect_identical(curves$seed, c(3, 3))
  # Two environments side by side: episodes in the order of their ends.
  dir.create(inside("two"))
  writeLines(c("#{\"t_start\": 100.5, \"env_id\": \"CartPole-v1\"}", "r,l,t", "11.0,11,0.5",
               "9.0,9,3.0"), inside("two", "0.monitor.csv"))
  writeLines(c("#{\"t_start\": 101.0, \"env_id\": \"CartPole-v1\"}", "r,l,t", "20.0,20,1.0"),
             inside("two", "1.monitor.csv"))
  curves <- learning_curves(inside("two"))
  expect_identical(curves$mean_return, c(11, 20, 9))
  expect_identical(curves$steps, c(11, 31, 40))
  expect_identical(unique(curves$kind), "training")
  expect_identical(unique(curves$env_id), "CartPole-v1")
  # Without evaluations, and without a monitor.
  writeLines(c("time/total_timesteps,rollout/ep_rew_mean", "2048,33"), inside("progress.csv"))
  expect_identical(learning_curves(inside("progress.csv"))$kind, "training")
})

test_that("the episodes of a Monitor's file stay in their order, also where it was resumed", {
  folder <- withr::local_tempdir()
  file <- file.path(folder, "0.monitor.csv")
  header <- "#{\"t_start\": 100.0, \"env_id\": \"CartPole-v1\"}"
  # A resumed file has no new header, and its clock begins at 0.
  writeLines(c(header, "r,l,t", "10,10,5", "20,20,9", "30,30,1", "40,40,6"), file)
  expect_identical(learning_curves(file)$mean_return, c(10, 20, 30, 40))
  expect_identical(learning_curves(file)$steps, c(10, 30, 60, 100))
  # Parallel environments were resumed together.
  writeLines(c(header, "r,l,t", "11,11,6", "21,21,8", "31,31,2"),
             file.path(folder, "1.monitor.csv"))
  expect_identical(learning_curves(folder)$mean_return, c(10, 11, 21, 20, 30, 31, 40))
})

test_that("a log without rows has none, and a damaged one is an error, or left out beside others", {
  folder <- withr::local_tempdir()
  write <- function(lines, ...) {
    file <- file.path(folder, ...)
    dir.create(dirname(file), showWarnings = FALSE, recursive = TRUE)
    writeLines(lines, file)
    file
  }
  monitor <- "#{\"t_start\": 100.0, \"env_id\": null}"
  empty <- list(
    write(c(monitor, "r,l,t"), "a", "monitor.csv"), write(monitor, "b", "monitor.csv"),
    write("time/total_timesteps,rollout/ep_rew_mean", "c", "progress.csv"),
    write("time/total_timesteps,eval/mean_reward", "d", "progress.csv"),
    write("Wall time,Step,Value", "e", "run.csv"),
    write("_step,charts/episodic_return", "f", "history.csv")
  )
  for (file in empty) {
    for (path in c(file, dirname(file))) {
      expect_identical(learning_curves(path), learning_curves(), info = path)
    }
  }
  config <- write("{\"env\": \"A\", \"seed\": 1}", "own", "config.json")
  evaluations <- "\"iteration\",\"steps\",\"kind\",\"mean_return\""
  write(evaluations, "own", "evaluations.csv")
  expect_identical(learning_curves(dirname(config)), learning_curves())
  damaged <- list(
    write(c("#{\"t_sta", "r,l,t", "1,1,1"), "g", "monitor.csv"),
    write(c(monitor, "r,l", "1,1"), "h", "monitor.csv"),
    write(c(monitor, "r,l,t", "1,x,1"), "i", "monitor.csv"),
    write(c("time/total_timesteps,eval/mean_reward", "10,word"), "j", "progress.csv"),
    write(c("Wall time,Step,Value", "1,2,3,4,5,6", "1"), "k", "run.csv")
  )
  for (file in damaged) {
    for (path in c(file, dirname(file))) {
      expect_error(learning_curves(path), class = "gym_error_argument", info = path)
    }
  }
  write("{", "own", "config.json")
  expect_error(learning_curves(dirname(config)), "is damaged", class = "gym_error_argument")
  write(character(), "l", "monitor.csv")
  expect_error(learning_curves(file.path(folder, "l")), "no log", class = "gym_error_argument")
  # A valid neighbour is still read: a folder, a file, and another kind of file.
  write(c(monitor, "r,l,t", "7,3,1", "8"), "m", "monitor.csv")
  warned <- capture_warnings(curves <- learning_curves(folder))
  expect_length(grep("is damaged", warned), 6)
  expect_identical(curves$mean_return, 7)
  write(c("time/total_timesteps,eval/mean_reward", "10,word"), "m", "progress.csv")
  expect_warning(curves <- learning_curves(file.path(folder, "m")), "left out",
                 class = "gym_warning_log")
  expect_identical(curves$steps, 3)
  write("time/total_timesteps,rollout/ep_rew_mean", "m", "progress.csv")
  expect_identical(learning_curves(file.path(folder, "m"))$steps, 3)
  write(c("time/total_timesteps,rollout/ep_rew_mean", "9,4"), "a", "progress.csv")
  expect_identical(learning_curves(file.path(folder, "a"))$mean_return, 4)
})

test_that("curves are returned on a common grid of steps", {
  ars <- quiet_trainings()
  curves <- learning_curves(ars)
  at <- c(0, 100, 1e6)
  grid <- learning_curves(ars, at = at)
  expect_identical(names(grid), names(curves))
  expect_identical(grid$steps, rep(at, 2))
  expect_identical(unique(grid$kind), "interpolated")
  own <- curves[curves$seed == 2, ]
  last <- own[!duplicated(own$steps, fromLast = TRUE), ]
  expect_identical(grid$mean_return[grid$seed == 2],
                   stats::approx(last$steps, last$mean_return, at, rule = 2)$y)
  expect_identical(grid$mean_return[[6]], own$mean_return[[nrow(own)]])
  # Before the first evaluation there is no value.
  later <- ars$trainings[[1]]
  later$evaluations <- later$evaluations[-1, ]
  at <- min(evaluation_steps(later)) + c(-1, 0, 1)
  expect_identical(is.na(learning_curves(later, at = at)$mean_return), c(TRUE, FALSE, FALSE))
  expect_identical(nrow(learning_curves(at = at)), 0L)
  expect_error(learning_curves(ars, at = "all"), class = "gym_error_argument")
})

test_that("CSV files of CleanRL are read", {
  folder <- withr::local_tempdir()
  inside <- function(...) file.path(folder, ...)
  run <- function(seed) paste0("CartPole-v1__ppo__", seed, "__1700000000")
  columns <- paste0(run(c(1, 7)), " - charts/episodic_return")
  writeLines(c(
    paste0("\"global_step\",", paste0("\"", rep(columns, each = 2), c("", "__MAX"), "\"",
                                      collapse = ",")),
    "10,10,99,,", "30,,,20,99", "60,40,99,30,99"
  ), inside("wandb.csv"))
  curves <- learning_curves(ppo = inside("wandb.csv"))
  expect_identical(curves$seed, c(1, 1, 7, 7))
  expect_identical(curves$steps, c(10, 60, 30, 60))
  expect_identical(curves$mean_return, c(10, 40, 20, 30))
  expect_identical(unique(curves$env_id), "CartPole-v1")
  # TensorBoard's, a file for each run, in a folder.
  dir.create(inside("board"))
  for (seed in 2:3) {
    writeLines(c("Wall time,Step,Value", "1700000001.5,22,22.0"),
               inside("board", paste0("run-", run(seed), "-tag-charts_episodic_return.csv")))
  }
  curves <- learning_curves(inside("board"))
  expect_identical(curves$seed, c(2, 3))
  expect_identical(unique(curves$env_id), "CartPole-v1")
  writeLines(c("_step,charts/episodic_return", "5,1", "9,2"), inside("history.csv"))
  expect_identical(learning_curves(inside("history.csv"))$steps, c(5, 9))
})

test_that("what is no log, or no training, is refused", {
  folder <- withr::local_tempdir()
  writeLines("a,b", file.path(folder, "other.csv"))
  for (wrong in list(folder, file.path(folder, "other.csv"), "no-such-folder", 3)) {
    expect_error(learning_curves(x = wrong), class = "gym_error_argument")
  }
  kept <- file.path(folder, "kept.rds")
  saveRDS(as.list(1:1000), kept)
  expect_no_warning(expect_error(learning_curves(kept), "readRDS", class = "gym_error_argument"))
  search <- search_random(fake_environment(), rounds = 2, seed = 1)
  expect_error(learning_curves(search), "agent_random", class = "gym_error_argument")
})
