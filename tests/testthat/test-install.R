# What the package's own tests cannot do without the network is in one test, so that packages are
# downloaded once.

test_that("an installation runs the server, takes extras and repairs itself", {
  skip_unless_all()
  # The server of all tests is not to be one of those that are installed here.
  test_client()
  local_cache()
  skip_if_no_uv()
  skip_if_no_packages()
  suppressMessages(expect_message(python <- gym_server_install(), "Installed in"))
  expect_identical(python, installed_server()$python)
  expect_identical(python_candidates()[2L], python)

  # The tests' own environment comes first where it is active.
  withr::local_envvar(VIRTUAL_ENV = NA)
  server <- local_server()
  expect_identical(the_session$servers[[server$remote_base]]$python, python)
  local_env(client = server)$reset()
  error <- expect_error(gym_make("LunarLander-v3", client = server), class = "gym_error_http_400")
  expect_match(conditionMessage(error), "gym_server_install(extras = \"box2d\")", fixed = TRUE)

  # Its server goes on, and finds what is new.
  expect_identical(suppressMessages(gym_server_install("box2d")), python)
  expect_identical(installed_server()$extras, "box2d")
  local_env("FrozenLake-v1", client = server)$reset()
  local_env("LunarLander-v3", client = server)$reset()

  # All there: nothing is done, and what was asked for before is kept.
  expect_message(expect_identical(gym_server_install(), python), "is installed already")
  expect_identical(installed_server()$extras, "box2d")

  # A file of a package that nothing imports.
  typed <- installed_file(python, "flask/py.typed")
  unlink(typed)
  expect_match(try_environment(python, character()), "py.typed is missing", all = FALSE)
  suppressMessages(expect_message(gym_server_install(), "Installed in"))
  expect_true(file.exists(typed))
  # A package, and the Python.
  unlink(dirname(installed_file(python, "numpy/version.py")), recursive = TRUE)
  unlink(python)
  expect_null(installed_server())
  expect_identical(suppressMessages(gym_server_install()), python)
  expect_identical(installed_server()$extras, "box2d")
})

test_that("sessions that install at once share the environment", {
  skip_unless_all()
  local_cache()
  skip_if_no_packages()
  sessions <- lapply(c("box2d", "box2d"), function(extra) {
    processx::process$new(
      file.path(R.home("bin"), "Rscript"),
      c("-e", paste0("cat(gym::gym_server_install('", extra, "'))")), stdout = "|", stderr = "2>&1",
      env = c("current", R_LIBS = paste(.libPaths(), collapse = .Platform$path.sep))
    )
  })
  for (session in sessions) {
    session$wait()
    expect_match(session$read_all_output(), environment_python(environment_folder()), fixed = TRUE)
  }
  expect_true(has_all(installed_server(), "box2d"))
})

test_that("after a no nothing is installed, and a yes is asked for once", {
  local_cache()
  local_failing_uv("error: Failed to fetch")
  asked <- character()
  local_binding("ask_yes_no", function(question, ...) {
    asked <<- c(asked, question)
    length(asked) > 1L
  })
  expect_null(gym_server_install("video", ask = TRUE))
  expect_false(dir.exists(install_root()))
  expect_match(asked, "games of Gymnasium (with video)", fixed = TRUE)
  expect_match(asked, "about [0-9]+ MB to download, [0-9]+ MB on the disk")
  expect_match(asked, install_root(), fixed = TRUE)
  expect_error(suppressMessages(gym_server_install(ask = TRUE)), class = "gym_error_install")
  expect_length(asked, 2L)
})

test_that("an installation that fails leaves what was there before", {
  local_cache()
  folder <- fake_installation()
  local_failing_uv("error: failed to copy: No space left on device (os error 28)")
  error <- expect_error(
    suppressMessages(gym_server_install("box2d")), class = "gym_error_install"
  )
  expect_match(conditionMessage(error), "The disk is full", fixed = TRUE)
  expect_match(conditionMessage(error), install_log(), fixed = TRUE)
  expect_match(error$output, "os error 28", all = FALSE)
  expect_identical(installed_server()$folder, folder)
  expect_identical(installed_server()$extras, character())
  expect_identical(list.files(install_root()), c(basename(folder), "install.log"))
})

test_that("a GYM_PYTHON that cannot run the server is named before anything is done", {
  local_cache()
  skip_on_os("windows")
  old <- fake_program(withr::local_tempfile(), "echo python 3.9 CPython 64")
  withr::local_envvar(GYM_PYTHON = old)
  error <- expect_error(gym_server_install(), "which is Python 3.9", class = "gym_error_install")
  expect_match(conditionMessage(error), "Sys.unsetenv(\"GYM_PYTHON\")", fixed = TRUE)
  withr::local_envvar(GYM_PYTHON = "/no/such/python")
  expect_error(gym_server_install(), "does not run", class = "gym_error_install")
  expect_false(dir.exists(install_root()))
})

test_that("arguments are checked", {
  expect_error(gym_server_install("box3d"), class = "gym_error_argument")
  expect_error(gym_server_install(character(), "offline"), class = "gym_error_argument")
  expect_error(gym_server_install(offline = 1), class = "gym_error_argument")
  expect_error(gym_server_install(ask = NA), class = "gym_error_argument")
})
