# What the package's own tests cannot do without the network is in one test, so that packages are
# downloaded once.

test_that("an installation runs the server, takes extras, repairs itself and is shared", {
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

  # Without a network: a file of a package that nothing imports, the Python, a package, and then
  # another place, by two sessions at once. uv's cache has it all.
  withr::local_envvar(UV_OFFLINE = "1")
  typed <- installed_file(python, "flask/py.typed")
  unlink(typed)
  expect_identical(environment_problem(python), "flask/py.typed is missing")
  suppressMessages(expect_message(gym_server_install(), "Installed in"))
  expect_true(file.exists(typed))
  unlink(dirname(installed_file(python, "numpy/version.py")), recursive = TRUE)
  unlink(python)
  expect_null(installed_server())
  expect_identical(suppressMessages(gym_server_install()), python)
  expect_identical(installed_server()$extras, "box2d")
  withr::local_envvar(R_USER_CACHE_DIR = withr::local_tempdir())
  sessions <- lapply(1:2, function(i) {
    processx::process$new(
      file.path(R.home("bin"), "Rscript"), c("-e", "cat(gym::gym_server_install('box2d'))"),
      stdout = "|", stderr = "2>&1",
      env = c("current", R_LIBS = paste(.libPaths(), collapse = .Platform$path.sep))
    )
  })
  for (session in sessions) {
    session$wait()
    expect_match(session$read_all_output(), environment_python(environment_folder()), fixed = TRUE)
  }
  expect_identical(installed_server()$extras, "box2d")
  expect_null(environment_problem(installed_server()$python))
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
  expect_match(asked, "at most [0-9]+ MB to download, [0-9]+ MB on the disk")
  expect_match(asked, install_root(), fixed = TRUE)
  expect_error(suppressMessages(gym_server_install(ask = TRUE)), class = "gym_error_install")
  expect_length(asked, 2L)
})

test_that("the question says what an extra adds, and that uv is downloaded", {
  size <- function(extras) {
    as.numeric(sub(".* most ([0-9]+) MB .*", "\\1", install_question(extras, "/my/uv")))
  }
  expect_gt(size(c("box2d", "atari")), size(character()) + 50)
  expect_match(install_question(character(), "/my/uv"), "by uv /my/uv", fixed = TRUE)
  expect_match(install_question(character(), NULL), "uv [0-9.]+ \\(which is downloaded\\)")
})

test_that("an installation that fails leaves what was there before", {
  local_cache()
  folder <- fake_installation()
  local_failing_uv("error: failed to copy: No space left on device (os error 28)")
  error <- expect_error(
    suppressMessages(gym_server_install("box2d")), class = "gym_error_install"
  )
  expect_match(conditionMessage(error), "The disk is full", fixed = TRUE)
  expect_match(error$output, "os error 28", all = FALSE)
  expect_identical(installed_server()$folder, folder)
  expect_identical(installed_server()$extras, character())
})

test_that("packages come with their hashes, and none is built", {
  skip_on_os("windows")
  local_cache()
  folder <- fake_installation()
  fake_program(environment_python(folder), "echo True")
  # What an earlier version of the package installed is kept.
  fake_installation("atari", hash = "0123456789ab")
  uv <- local_fake_uv()
  expect_identical(suppressMessages(gym_server_install("box2d")), environment_python(folder))
  expect_match(calls_of(uv), paste0(
    "^--directory .* pip sync --python .*/venv/bin/python --require-hashes --no-build ",
    "--compile-bytecode .*/base.txt .*/box2d.txt .*/atari.txt$"
  ))
})

test_that("a Python that only ends in order cannot run the server", {
  skip_on_os("windows")
  local_cache()
  fake_installation()
  expect_identical(environment_problem(installed_server()$python), "it ended without output")
})

test_that("uv installs a Python, or takes one of this machine's, or the one that UV_PYTHON names", {
  local_cache()
  folder <- fake_installation()
  made <- fake_program(environment_python(folder), "echo True")
  venv <- function() sub(".* venv --allow-existing", "", calls_of(uv))
  uv <- local_fake_uv()
  expect_silent(make_venv(uv, folder, NULL))
  expect_identical(venv(), paste0(" --managed-python --python 3.12 ", folder, "/venv"))
  uv <- local_fake_uv("case \"$*\" in *--no-managed-python*) exit; esac; exit 2")
  expect_silent(make_venv(uv, folder, NULL))
  expect_match(venv()[[2L]], "--no-python-downloads --python cpython>=3.10,<3.14", fixed = TRUE)
  uv <- local_failing_uv("error: Failed to download `https://me:secret@python.example/`")
  error <- expect_error(make_venv(uv, folder, NULL), class = "gym_error_install")
  expect_match(conditionMessage(error), "UV_PYTHON_INSTALL_MIRROR", fixed = TRUE)
  expect_false(any(grepl("secret", unlist(error), fixed = TRUE)))

  withr::local_envvar(UV_PYTHON = "/my/python")
  uv <- local_fake_uv()
  expect_silent(make_venv(uv, folder, NULL))
  expect_identical(venv(), paste0(" ", folder, "/venv"))
  # One that the server cannot use is no environment.
  fake_program(environment_python(folder), "echo False")
  error <- expect_error(make_venv(uv, folder, NULL), class = "gym_error_install")
  expect_match(conditionMessage(error), "Sys.unsetenv(\"UV_PYTHON\")", fixed = TRUE)
  # Without this file it would be the Python that the environment was made from.
  fake_program(environment_python(folder), "echo True")
  expect_true(has_venv(folder))
  unlink(file.path(folder, "venv", "pyvenv.cfg"))
  expect_false(has_venv(folder))
})

test_that("a cache folder that cannot be made is an error that says what to set", {
  local_cache()
  skip_if_no_uv()
  file <- withr::local_tempfile(lines = "not a folder")
  withr::local_envvar(R_USER_CACHE_DIR = file)
  expect_error(gym_server_install(), "R_USER_CACHE_DIR", class = "gym_error_install")
})

test_that("what installed from a folder has ended, and says what replaces it", {
  expect_error(gym_server_install(offline = "bundle"), "its cache", class = "gym_error_defunct")
  expect_error(gym_server_bundle("bundle"), "its cache", class = "gym_error_defunct")
})

test_that("arguments are checked", {
  expect_error(gym_server_install("box3d"), class = "gym_error_argument")
  expect_error(gym_server_install(character(), "offline"), class = "gym_error_argument")
  expect_error(gym_server_install(ask = NA), class = "gym_error_argument")
})
