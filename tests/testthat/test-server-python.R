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

test_that("a Python that cannot run the server says why", {
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  problem <- function(...) python_problem(fake_program(file.path(folder, "python3"), ...), 20)
  set.seed(1)
  before <- .Random.seed
  expect_null(python_problem(working_python()))
  expect_identical(.Random.seed, before)
  expect_identical(problem(
    "echo \"gym_server cannot run on this Python (3.12.1, /x (y)): No module named 'flask'\" >&2",
    "exit 78"
  ), "No module named 'flask'")
  expect_identical(problem("exit 1"), "it ended without output")
  expect_identical(problem("exit 0"), "it ended without output")
  expect_match(python_problem("/no/such/python"), "there is no such file")
  hanging <- fake_program(file.path(folder, "hanging"), "exec sleep 60")
  expect_match(python_problem(hanging, timeout = 0.5), "does not answer in 0.5 s")
})
