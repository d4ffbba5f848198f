test_that("Python is looked for in the order of the help page", {
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

test_that("what is to be typed in a terminal is quoted for the system's own", {
  expect_identical(quote_for_terminal("a b"), if (is_windows()) "\"a b\"" else "'a b'")
  local_binding("is_windows", function() TRUE)
  expect_identical(quote_for_terminal("C:/a b"), "\"C:/a b\"")
})

test_that("the stand-in for Python of macOS without developer tools is left alone", {
  skip_on_os("windows")
  skip_if_not(any(file.exists(c("/usr/bin/python3", "/usr/bin/python"))), "no Python in /usr/bin")
  withr::local_envvar(GYM_PYTHON = NA, VIRTUAL_ENV = NA, CONDA_PREFIX = NA, PATH = "/usr/bin")
  expect_true(any(startsWith(python_candidates(), "/usr/bin/")))
  local_binding("lacks_developer_tools", function() TRUE)
  expect_false(any(startsWith(python_candidates(), "/usr/bin/")))
})
