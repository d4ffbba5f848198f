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
