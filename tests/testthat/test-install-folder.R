test_that("an environment is found when it is whole, and by no other lock", {
  local_cache()
  expect_null(installed_server())
  folder <- fake_installation(extras = c("box2d", "video"))
  there <- installed_server()
  expect_identical(there$folder, folder)
  expect_identical(there$python, environment_python(folder))
  expect_identical(there$extras, c("box2d", "video"))
  expect_identical(there$python, Find(is_installed_python, python_candidates()))
  unlink(folder, recursive = TRUE)
  fake_installation(hash = "0123456789ab", extras = "atari")
  expect_null(installed_server())
  expect_identical(earlier_extras(), "atari")
})

test_that("what was interrupted or damaged is no environment", {
  local_cache()
  folder <- fake_installation()
  unlink(file.path(folder, "venv", "lib", "python3.12", "site-packages", "numpy"),
         recursive = TRUE)
  unlink(file.path(folder, "venv", "Lib", "site-packages", "numpy"), recursive = TRUE)
  expect_null(installed_server())
  second <- fake_installation(2)
  expect_identical(installed_server()$folder, second)
  unlink(environment_python(second))
  expect_null(installed_server())
  third <- fake_installation(3)
  manifest <- readLines(file.path(third, "installed"))
  writeLines(head(manifest, -1L), file.path(third, "installed"))
  expect_null(installed_server())
  fourth <- fake_installation(4)
  unlink(file.path(fourth, "installed"))
  expect_null(installed_server())
})

test_that("only what no session uses is removed", {
  skip_on_os("windows")
  local_cache()
  used <- fake_installation(1)
  unused <- fake_installation(2)
  kept <- fake_installation(3)
  other <- processx::process$new("sleep", "60")
  withr::defer(other$kill())
  for (folder in c(used, unused)) {
    dir.create(file.path(folder, "used-by"))
  }
  node <- Sys.info()[["nodename"]]
  writeLines(node, file.path(used, "used-by", other$get_pid()))
  # This session runs no server from there.
  writeLines(node, file.path(unused, "used-by", Sys.getpid()))
  remove_other_folders(kept)
  expect_identical(dir.exists(c(used, unused, kept)), c(TRUE, FALSE, TRUE))
  expect_true(file.exists(environment_python(used)))
  # It is in nobody's way any more, and goes the next time.
  expect_identical(installed_server()$folder, kept)
  expect_identical(basename(next_folder()), paste0(lock_hash(), "-4"))
  other$kill()
  remove_other_folders(kept)
  expect_false(dir.exists(used))
})

test_that("an environment that a machine elsewhere uses is left alone for a month", {
  local_cache()
  folder <- fake_installation()
  dir.create(file.path(folder, "used-by"))
  mark <- file.path(folder, "used-by", "1")
  writeLines("another-machine", mark)
  expect_true(is_used(folder))
  Sys.setFileTime(mark, Sys.time() - 31 * 86400)
  expect_false(is_used(folder))
})

test_that("two sessions never make the same folder", {
  local_cache()
  first <- make_folder(NULL)
  second <- make_folder(NULL)
  expect_false(first == second)
  end_folder(first, complete = FALSE)
  expect_false(dir.exists(first))
  end_folder(second, complete = TRUE)
  expect_identical(list.files(file.path(second, "used-by")), character())
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

test_that("what could only be renamed goes the next time", {
  local_cache()
  kept <- fake_installation(2)
  renamed <- paste0(file.path(install_root(), paste0(lock_hash(), "-1")), "-old")
  dir.create(file.path(renamed, "venv"), recursive = TRUE)
  remove_other_folders(kept)
  expect_identical(list.files(install_root()), basename(kept))
})

test_that("a cache folder that cannot be made is an error that says what to set", {
  file <- withr::local_tempfile(lines = "not a folder")
  withr::local_envvar(R_USER_CACHE_DIR = file)
  expect_error(make_folder(NULL), "R_USER_CACHE_DIR", class = "gym_error_install")
  expect_error(with_install_lock(1), "R_USER_CACHE_DIR", class = "gym_error_install")
})

test_that("tests see nothing of what the user has installed", {
  expect_true(startsWith(install_root(), paste0(tempdir(), "/gym-cache-")))
  expect_null(installed_server())
})
