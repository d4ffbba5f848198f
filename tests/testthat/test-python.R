test_that("Python is looked for in the order that the help page tells", {
  folder <- withr::local_tempdir()
  commands <- file.path(folder, c("venv/bin/python3", "path/python3", "WindowsApps/python3"))
  for (command in commands) {
    dir.create(dirname(command), recursive = TRUE)
    writeLines(command, command)
    Sys.chmod(command, "755")
  }
  skip_on_os("windows")
  withr::local_envvar(
    GYM_PYTHON = NA, VIRTUAL_ENV = file.path(folder, "venv"), CONDA_PREFIX = NA,
    PATH = paste(file.path(folder, c("WindowsApps", "path")), collapse = ":")
  )
  expect_identical(python_candidates(), commands[1:2])
  expect_identical(python_candidates("/my/python"), "/my/python")
  withr::local_envvar(GYM_PYTHON = "/its/python")
  expect_identical(python_candidates(), "/its/python")
  expect_identical(python_candidates("/my/python"), "/my/python")
})
