test_that("environments in R, models and bandits are played where there is no Python", {
  skip_unless_all()
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"), readLines(test_path("play_without_python.R"))
  ))
  run <- processx::run(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", script), timeout = 120,
    wd = withr::local_tempdir(), error_on_status = FALSE
  )
  expect_identical(run$stdout, "")
  expect_identical(run$status, 0L)
})
