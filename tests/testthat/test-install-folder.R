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
})

test_that("only what another version left and nobody used for a month is removed", {
  local_cache()
  own <- fake_installation()
  unused <- fake_installation("box2d", hash = "0123456789aa")
  used <- fake_installation("atari", hash = "0123456789ab")
  for (path in file.path(c(own, unused, used), "installed")) {
    Sys.setFileTime(path, Sys.time() - 31 * 86400)
  }
  # As when a server starts.
  use_python(environment_python(used))
  remove_old_folders()
  expect_identical(dir.exists(c(own, unused, used)), c(TRUE, FALSE, TRUE))
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
})

test_that("tests see nothing of what the user has installed", {
  expect_true(startsWith(install_root(), paste0(tempdir(), "/gym-cache-")))
  expect_null(installed_server())
})

test_that("every part is locked, each package with its hashes", {
  for (path in lock_files(server_extras)) {
    lines <- readLines(path)
    pinned <- grep("==", lines, fixed = TRUE)
    expect_true(all(grepl("^[a-z0-9-]+==[0-9][^ ]*( ; [^\\\\]+)? \\\\$", lines[pinned])))
    expect_true(all(grepl("^    --hash=sha256:[0-9a-f]{64}( \\\\)?$", lines[pinned + 1L])))
  }
  expect_lt(sum(file.size(lock_files(server_extras))), 1e6)
})

test_that("the lock's hash does not depend on the ends of lines", {
  hash <- lock_hash()
  expect_match(hash, "^[0-9a-f]{12}$")
  folder <- withr::local_tempdir()
  for (path in lock_files(server_extras)) {
    con <- file(file.path(folder, basename(path)), "wb")
    writeLines(readLines(path), con, sep = "\r\n")
    close(con)
  }
  copies <- file.path(folder, basename(lock_files(server_extras)))
  local_binding("lock_files", function(extras) copies)
  expect_identical(lock_hash(), hash)
  cat("one more\n", file = copies[[3L]], append = TRUE)
  expect_false(lock_hash() == hash)
})

test_that("extras are checked", {
  expect_error(check_extras("box3d"), "box2d", class = "gym_error_argument")
  expect_error(check_extras(NA_character_), class = "gym_error_argument")
  expect_error(check_extras(1), class = "gym_error_argument")
  local_binding("system_name", function() "linux-aarch64")
  expect_error(check_extras("box2d"), "cannot be installed on this system",
               class = "gym_error_install")
  expect_error(check_extras("mujoco"), NA)
})
