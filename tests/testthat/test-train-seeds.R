quiet_trainings <- function(..., env = fake_environment(reward = first_action), seeds = 1:3) {
  suppressMessages(
    train_agent(agent_ars(3, 2), env, iterations = 4, seeds = seeds, target = Inf,
                eval_every = 2, eval_episodes = 4, ...),
    classes = "gym_message_resumed"
  )
}

test_that("the training of each seed is the one that the seed makes alone", {
  skip_unless_all()
  trained <- quiet_trainings(seeds = c(5, 2, 1e5))
  expect_s3_class(trained, "gym_trainings")
  expect_named(trained$trainings, c("5", "2", "100000"))
  for (seed in c(5, 2, 1e5)) {
    alone <- train_agent(agent_ars(3, 2), fake_environment(reward = first_action), iterations = 4,
                         seed = seed, target = Inf, eval_every = 2, eval_episodes = 4)
    name <- format(seed, scientific = FALSE)
    expect_identical(what_counts(trained$trainings[[name]]), what_counts(alone))
  }
  weights <- coef(trained)
  expect_identical(rownames(weights), c("5", "2", "100000"))
  expect_identical(weights["2", ], coef(trained$trainings[["2"]]))
  # Without a target there is nothing to reach.
  expect_false(any(grepl("target|early", capture.output(print(trained)))))
  expect_identical(as.data.frame(trained)$reached, rep(NA, 3))
  expect_identical(trained$trainings[[1]]$solved, NA)
})

test_that("a row for each seed says whether its final evaluation has reached the target", {
  skip_unless_all()
  # The final evaluation has the seeds above this.
  lucky <- function(seed, step, action) if (seed <= 2^30 + 2^29) 10 else 1
  trained <- train_agent(agent_hill_climb(), fake_environment(reward = lucky), iterations = 2,
                         seeds = 1:3, target = 20, eval_episodes = 4)
  table <- as.data.frame(trained)
  expect_identical(table$seed, 1:3)
  expect_identical(table$mean_return, rep(3, 3))
  expect_identical(table$reached, rep(FALSE, 3))
  # Their stopping evaluations were lucky.
  expect_identical(table$stopped_early, rep(TRUE, 3))
  shown <- capture.output(print(trained))
  expect_match(shown, "Reached the target 20 with 0 of 3 seeds (95% interval from 0% to 56%)",
               fixed = TRUE, all = FALSE)
  expect_match(shown, "Stopped early: 3 of 3", fixed = TRUE, all = FALSE)
  expect_false(any(grepl("olved", shown)))
  expect_identical(summary(trained), trained)
  # A single training says the same.
  one <- trained$trainings[[1]]
  expect_identical(one[c("solved", "stopped_early")], list(solved = FALSE, stopped_early = TRUE))
  shown <- capture.output(print(one))
  expect_match(shown, "Stopped early after 1 iteration", fixed = TRUE, all = FALSE)
  expect_length(grep(", target not reached", shown, fixed = TRUE), 1)
  # Without a target there is nothing to reach.
  expect_false(any(grepl("target|early", capture.output(print(quiet_trainings())))))
})

test_that("the interval of a share is Wilson's", {
  for (case in list(c(0, 20), c(7, 10), c(20, 20), c(1, 3))) {
    wanted <- suppressWarnings(
      stats::prop.test(case[[1]], case[[2]], correct = FALSE)$conf.int
    )
    expect_equal(wilson_interval(case[[1]], case[[2]]), as.vector(wanted), tolerance = 1e-12)
  }
  expect_identical(wilson_interval(0, 0), c(NA_real_, NA_real_))
})

test_that("each seed has its own checkpoint and log, and all go on from there", {
  skip_unless_all()
  folder <- withr::local_tempdir()
  path <- file.path(folder, "my.training.rds")
  first <- quiet_trainings(checkpoint = path, log = file.path(folder, "log"))
  expect_setequal(
    list.files(folder, recursive = TRUE),
    c(paste0("my.training-", 1:3, ".rds"),
      paste0("log/seed-", rep(1:3, each = 3), "/",
             c("config.json", "evaluations.csv", "progress.csv")))
  )
  unlink(file.path(folder, "my.training-2.rds"))
  idle <- fake_environment(reward = first_action)
  again <- quiet_trainings(checkpoint = path, env = idle)
  expect_identical(lapply(again$trainings, what_counts), lapply(first$trainings, what_counts))
  # Only the second was trained again.
  expect_length(idle$seeds, 6 * 4 + 2 * 4 + 4)
})

test_that("relative files of all seeds lie in the folder at the start, whatever a callback does", {
  folder <- withr::local_tempdir()
  other <- withr::local_tempdir()
  withr::local_dir(folder)
  callback <- function(training) {
    setwd(other)
    TRUE
  }
  trained <- quiet_trainings(checkpoint = "kept.rds", log = "log", callback = callback)
  expect_identical(list.files(other), character())
  setwd(folder)
  expect_setequal(list.files(), c("log", paste0("kept-", 1:3, ".rds")))
  for (seed in 1:3) {
    log <- utils::read.csv(file.path("log", paste0("seed-", seed), "progress.csv"))
    expect_length(log[[1L]], nrow(trained$trainings[[seed]]$history))
    file <- file.path(folder, paste0("kept-", seed, ".rds"))
    expect_false(is.null(read_checkpoint(file, NULL)$training$final))
  }
})

test_that("an interrupt and an error keep the trainings before them, and the one that they met", {
  skip_unless_all()
  stopping <- function(stop_it) {
    env <- fake_environment(reward = first_action)
    step <- env$step
    # Of 36 episodes a training: in the third iteration of the second.
    env$step <- function(action) if (length(env$seeds) == 57L) stop_it() else step(action)
    env
  }
  whole <- quiet_trainings()
  expect_message(trained <- quiet_trainings(env = stopping(rlang::interrupt)),
                 "after 1 of 3 seeds", class = "gym_message_interrupted")
  expect_true(trained$interrupted)
  expect_identical(what_counts(trained$trainings[[1]]), what_counts(whole$trainings[[1]]))
  expect_identical(nrow(trained$trainings[[2]]$history), 2L)
  expect_identical(as.data.frame(trained)$interrupted, c(FALSE, TRUE))
  expect_output(print(trained), "Interrupted after 1 seed,")
  cnd <- expect_error(quiet_trainings(env = stopping(function() gym_abort("lost"))),
                      "after 1 seed", class = "gym_error_training")
  expect_identical(nrow(cnd$result$trainings[[2]]$history), 2L)
  expect_identical(what_counts(cnd$result$trainings[[1]]), what_counts(whole$trainings[[1]]))
})

test_that("a seed that cannot begin keeps the trainings before it", {
  folder <- withr::local_tempdir()
  file.create(file.path(folder, "seed-2"))
  cnd <- expect_error(quiet_trainings(log = folder), "after 1 seed", class = "gym_error_training")
  expect_s3_class(cnd, "gym_error_argument")
  expect_identical(as.data.frame(cnd$result)$seed, 1L)
  # Of the first seed nothing was trained: the error is what it is.
  expect_error(quiet_trainings(log = folder, seeds = 2:3), "cannot be written",
               class = "gym_error_argument")
})

test_that("seeds that are wrong are refused before anything is made", {
  refused <- function(..., name) {
    cnd <- expect_error(
      train_agent(agent_ars(), "CartPole-v1", iterations = 1, ..., client = no_client()),
      class = "gym_error_argument"
    )
    expect_identical(cnd$argument, name)
  }
  refused(seeds = "a", name = "seeds")
  refused(seeds = c(1, 1), name = "seeds")
  refused(seeds = c(1, 0.5), name = "seeds[2]")
  refused(seeds = 1:2, seed = 3, name = "seed")
})

test_that("an environment of the server trains many seeds, with its own arguments", {
  play <- function(...) {
    train_agent(agent_ars(2, version = "V1"), "FrozenLake-v1", is_slippery = FALSE, iterations = 2,
                max_steps = 20, eval_episodes = 2, num_envs = 4, client = test_client(), ...)
  }
  trained <- play(seeds = 1:2)
  expect_identical(what_counts(trained$trainings[[2]]), what_counts(play(seed = 2L)))
  expect_identical(provenance(trained)$kwargs, list(is_slippery = FALSE))
  expect_identical(provenance(trained)$seed, c(1, 2))
})
