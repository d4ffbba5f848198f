test_that("a process that crashes is said to have crashed, with the signal", {
  skip_on_os("windows")
  python <- working_python()
  process <- NULL
  start <- start_python
  local_functions(start_python = function(...) process <<- start(...))
  # No job ends before the signal: its import takes longer.
  crash <- function() process$signal(11L)
  expect_error(
    run_sb3_job(list(task = "train"), withr::local_tempdir(), python, NULL, crash),
    "ended without a result.*signal 11[.]", class = "gym_error_training"
  )
})

test_that("Stable-Baselines3 that is not installed is named, with the command", {
  bare <- withr::local_tempdir()
  run_quietly(working_python(), c("-m", "venv", "--without-pip", bare), 120)
  python <- pythons_in(file.path(bare, if (is_windows()) "Scripts" else "bin"))[[1L]]
  local_session(servers = list())
  withr::local_envvar(GYM_PYTHON = python)
  expect_error(
    learn_sb3("SAC", "Pendulum-v1", 100), "not installed.*-m pip install stable-baselines3",
    class = "gym_error_install"
  )
})
