# Runs a script of inst/examples from top to bottom, and returns what it prints and the environment
# in which it ran. The scripts that need a server are left to the other tests.
run_example <- function(name) {
  file <- system.file("examples", name, package = "gym", mustWork = TRUE)
  run <- new.env(parent = globalenv())
  withr::local_pdf(NULL)
  printed <- withr::with_preserve_seed(utils::capture.output(sys.source(file, run)))
  list(printed = printed, env = run)
}

test_that("the bandit shows that it pays to explore", {
  skip_unless_all()
  run <- run_example("bandit.R")
  reward <- vapply(run$env$played, function(played) mean(played$rewards[901:1000]), 0)
  expect_identical(order(reward), 1:3)
  # Figure 2.2 of the book: about 1 without exploring, 1.4 with a probability of 0.1.
  expect_lt(abs(reward[[1]] - 1), 0.15)
  expect_lt(abs(reward[[3]] - 1.4), 0.15)
})

test_that("Sarsa finds the shortest way through the windy gridworld", {
  skip_unless_all()
  run <- run_example("windy-gridworld.R")
  expect_match(run$printed, "Nothing is wrong", fixed = TRUE, all = FALSE)
  expect_identical(run$env$learned$episodes$length, 15L)
  expect_true(run$env$learned$episodes$terminated)
  run$env$windy$reset()
  expect_s3_class(run$env$windy$render(), "gym_frame")
})

test_that("the inventory never ends, and a rule of two numbers beats chance", {
  skip_unless_all()
  run <- run_example("inventory.R")
  expect_match(run$printed, "No episode ended within 200 steps", fixed = TRUE, all = FALSE)
  expect_identical(unique(run$env$chance$episodes$length), 365L)
  expect_gt(max(run$env$rules$profit), mean(run$env$chance$episodes$return) / 365 + 2)
})

test_that("the trainings for a queue are run one after the other where there is no Slurm", {
  skip_if_not(tests_all(), "left to make test-all")
  skip_if_not_installed("future.batchtools")
  skip_if(nzchar(Sys.which("sbatch")), "Slurm is there")
  test_client()
  folder <- withr::local_tempdir()
  withr::local_envvar(GYM_RESULTS = folder)
  # batchtools keeps its registry in the working directory.
  withr::local_dir(withr::local_tempdir())
  withr::defer(future::plan("sequential"))
  run <- run_example("slurm.R")
  expect_named(run$env$trained$trainings, c("1", "2"))
  expect_setequal(list.files(folder, "rds$"), paste0("acrobot-", 1:2, ".rds"))
  expect_setequal(list.files(file.path(folder, "acrobot")), paste0("seed-", 1:2))
})
