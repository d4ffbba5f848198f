source_of <- function(uv, ...) {
  utils::modifyList(list(uv = uv, python = "3.12", other_python = ">=3.10"), list(...))
}

test_that("uv installs a Python, or takes one of this machine's", {
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  uv <- local_fake_uv("case \"$*\" in *--managed-python*) exit 0; esac", "exit 2")
  expect_silent(make_venv("/e", source_of(uv), NULL))
  expect_identical(
    calls_of(uv), "venv --allow-existing --managed-python --python 3.12 /e/venv"
  )
  uv <- local_fake_uv(
    "case \"$*\" in *--no-managed-python*) echo 'Using CPython 3.10.2 at: /usr/bin/p'; exit; esac",
    "exit 2"
  )
  expect_message(make_venv("/e", source_of(uv), NULL), "Using CPython 3.10.2", fixed = TRUE)
  expect_match(calls_of(uv)[2L], "--no-python-downloads --python >=3.10 /e/venv", fixed = TRUE)
  uv <- local_failing_uv("error: Failed to download `https://me:secret@python.example/`")
  error <- expect_error(make_venv("/e", source_of(uv), NULL), class = "gym_error_install")
  expect_match(conditionMessage(error), "Python 3.12, and found no suitable one on this machine")
  expect_match(conditionMessage(error), "UV_PYTHON_INSTALL_MIRROR", fixed = TRUE)
  expect_false(any(grepl("secret", c(unlist(error), readLines(install_log())), fixed = TRUE)))
})

test_that("UV_PYTHON names the Python of an environment", {
  skip_unless_all()
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  withr::local_envvar(UV_PYTHON = "/my/python")
  folder <- fake_installation(character(), lock_hash(), "echo python 3.13 CPython 64")
  uv <- local_fake_uv("echo 'Using CPython 3.13'")
  expect_silent(make_venv(folder, network_source(uv), NULL))
  expect_identical(
    calls_of(uv), paste0("venv --allow-existing --python /my/python ", folder, "/venv")
  )
  # An environment that the server cannot use is not kept.
  folder <- fake_installation(character(), lock_hash(), "echo python 3.9 CPython 64")
  expect_error(
    make_venv(folder, network_source(uv), NULL), "UV_PYTHON names, /my/python",
    class = "gym_error_install"
  )
  expect_false(has_venv(folder))
  uv <- local_failing_uv("error: No interpreter found at path `/my/python`")
  error <- expect_error(make_venv("/e", network_source(uv), NULL), class = "gym_error_install")
  expect_match(conditionMessage(error), "UV_PYTHON names, /my/python", fixed = TRUE)
  expect_match(conditionMessage(error), "Sys.unsetenv(\"UV_PYTHON\")", fixed = TRUE)
})

test_that("packages come with their hashes, and none is built", {
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  uv <- local_fake_uv()
  install_packages("/e", source_of(uv, arguments = "--offline"), "box2d", NULL)
  expect_match(calls_of(uv), "^pip sync --python /e/venv/bin/python --require-hashes --no-build ")
  expect_match(calls_of(uv), "--offline .*/base.txt .*/box2d.txt$")
})

test_that("a Python that only ends in order cannot run the server", {
  skip_on_os("windows")
  local_cache()
  there <- fake_installation()
  expect_identical(installed_server()$folder, there)
  expect_true(failed(try_environment(environment_python(there), character())))
  expect_false(has_all(installed_server(), character()))
})
