test_that("uv does it where it is found, and installs a Python where none of its own is there", {
  local_cache()
  uv <- local_fake_uv()
  plan <- install_plan("box2d")
  expect_identical(plan$uv, uv)
  expect_identical(plan$megabytes, lock_megabytes("box2d") + managed_python_megabytes)
  expect_match(describe_plan(plan), "and installing Python 3.12", fixed = TRUE)
  expect_false(dir.exists(install_root()))
  dir.create(file.path(managed_python_folder(), "cpython-3.12.1-linux"), recursive = TRUE)
  expect_identical(install_plan("box2d")$megabytes, lock_megabytes("box2d"))
  unlink(managed_python_folder(), recursive = TRUE)
  withr::local_envvar(UV_PYTHON = "3.13")
  expect_identical(install_plan("box2d")$megabytes, lock_megabytes("box2d"))
})

test_that("an environment that is there keeps its Python", {
  skip_on_os("windows")
  local_cache()
  folder <- fake_installation("video", lock_hash(), "echo python 3.11 CPython 64")
  expect_true(has_venv(folder))
  expect_false(install_plan("box2d")$new_python)
  expect_false(has_venv(folder, "3.12"))
  # It would be the Python that the environment was made from.
  unlink(file.path(folder, "venv", "pyvenv.cfg"))
  expect_false(has_venv(folder))
})

test_that("without uv it is downloaded", {
  local_cache()
  local_binding("find_uv", function(...) NULL)
  plan <- install_plan()
  expect_null(plan$uv)
  expect_identical(plan$megabytes,
                   lock_megabytes(character()) + managed_python_megabytes + uv_megabytes)
  expect_match(describe_plan(plan), "downloading uv [0-9.]+ and installing Python")
})
