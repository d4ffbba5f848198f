test_that("an environment is found when it is whole, and by no other lock", {
  local_cache()
  expect_null(installed_server())
  folder <- fake_installation(c("box2d", "video"))
  there <- installed_server()
  expect_identical(there$folder, folder)
  expect_identical(there$python, environment_python(folder))
  expect_identical(there$extras, c("box2d", "video"))
  expect_identical(there$python, Find(is_installed_python, python_candidates()))
  unlink(folder, recursive = TRUE)
  fake_installation("atari", hash = "0123456789ab")
  expect_null(installed_server())
  expect_identical(earlier_extras(), "atari")
})

test_that("what was interrupted or damaged is no environment", {
  local_cache()
  folder <- fake_installation()
  unlink(environment_python(folder))
  expect_null(installed_server())
  fake_installation()
  expect_false(is.null(installed_server()))
  manifest <- readLines(file.path(folder, "installed"))
  writeLines(head(manifest, -1L), file.path(folder, "installed"))
  expect_null(installed_server())
  unlink(file.path(folder, "installed"))
  expect_null(installed_server())
  expect_identical(earlier_extras(), character())
})

test_that("only what another version left and nobody used for a month is removed", {
  local_cache()
  own <- fake_installation()
  unused <- fake_installation("box2d", hash = "0123456789aa")
  used <- fake_installation("atari", hash = "0123456789ab")
  half <- file.path(install_root(), c("0123456789ac", "bundle-1", "download-1"))
  invisible(lapply(half, dir.create))
  for (path in c(own, unused, used, half, file.path(c(own, unused, used), "installed"))) {
    Sys.setFileTime(path, Sys.time() - 31 * 86400)
  }
  # As when a server starts.
  use_python(environment_python(used))
  remove_old_folders()
  expect_identical(dir.exists(c(own, unused, used)), c(TRUE, FALSE, TRUE))
  expect_false(any(dir.exists(half)))
  expect_identical(install_folders()[[1L]], used)
  expect_true(file.exists(environment_python(used)))
})

test_that("the cache folder's path is whole, also before it exists", {
  home <- withr::local_tempdir()
  withr::local_dir(home)
  withr::local_envvar(HOME = home, R_USER_CACHE_DIR = "~/my cache")
  skip_on_os("windows")
  expect_identical(install_root(), file.path(path.expand("~"), "my cache", "R", "gym"))
  withr::local_envvar(R_USER_CACHE_DIR = "here")
  expect_identical(install_root(), file.path(getwd(), "here", "R", "gym"))
  expect_false(dir.exists("here"))
  expect_identical(absolute_path("C:/x"), "C:/x")
  # A tool writes where R looks.
  dir.create(install_root(), recursive = TRUE)
  run_tool("/bin/sh", c("-c", "echo x > \"$0\"", file.path(install_root(), "x")))
  expect_true(file.exists(file.path(home, "here", "R", "gym", "x")))
})

test_that("a cache folder that cannot be made is an error that says what to set", {
  local_cache()
  skip_if_no_uv()
  file <- withr::local_tempfile(lines = "not a folder")
  withr::local_envvar(R_USER_CACHE_DIR = file)
  expect_error(gym_server_install(), "R_USER_CACHE_DIR", class = "gym_error_install")
  expect_error(
    gym_server_bundle(withr::local_tempdir()), "R_USER_CACHE_DIR", class = "gym_error_install"
  )
})

test_that("tests see nothing of what the user has installed", {
  expect_true(startsWith(install_root(), paste0(tempdir(), "/gym-cache-")))
  expect_null(installed_server())
})
