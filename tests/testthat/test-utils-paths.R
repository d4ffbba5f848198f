# What differs on Windows, where the tests seldom run: its branches, in folders with blanks, umlauts
# and backslashes. Programs are stand-ins with Windows' names.

local_windows <- function(frame = parent.frame()) {
  local_binding("is_windows", function() TRUE, frame = frame)
}

# A program of this system, so that it also runs where Windows is a fake.
stand_in <- function(path, answer) {
  dir.create(dirname(path), recursive = TRUE, showWarnings = FALSE)
  writeLines(c("#!/bin/sh", paste("echo", answer)), path)
  Sys.chmod(path, "755")
  path
}

test_that("backslashes separate folders on Windows alone", {
  expect_identical(absolute_path("a\\b"), file.path(getwd(), if (is_windows()) "a/b" else "a\\b"))
  local_windows()
  expect_identical(
    absolute_path("C:\\Users\\J\u00f6rg M\\a.rds"), "C:/Users/J\u00f6rg M/a.rds"
  )
  expect_identical(absolute_path("\\\\server\\share\\a"), "//server/share/a")
  expect_identical(absolute_path("runs\\a"), file.path(getwd(), "runs/a"))
})

test_that("on Windows the Python of an active environment is found below Scripts", {
  skip_on_os("windows")
  active <- file.path(withr::local_tempdir(), "J\u00f6rg M")
  python <- stand_in(file.path(active, "Scripts", "python.exe"), "Python")
  withr::local_envvar(GYM_PYTHON = NA, VIRTUAL_ENV = active, CONDA_PREFIX = NA, PATH = "")
  expect_false(python %in% python_candidates())
  local_windows()
  expect_identical(python_candidates()[[1L]], python)
})

test_that("on Windows uv is found in the user's profile", {
  skip_on_os("windows")
  home <- withr::local_tempdir()
  withr::local_envvar(USERPROFILE = home, RETICULATE_UV = NA, PATH = "",
                      R_USER_CACHE_DIR = withr::local_tempdir())
  uv <- stand_in(file.path(home, ".local", "bin", "uv.exe"), "uv 0.12.16")
  expect_false(uv %in% uv_candidates())
  local_windows()
  expect_identical(uv_candidates(), uv)
})

test_that("on Windows the archive of uv is a zip file", {
  skip_on_os("windows")
  folder <- file.path(withr::local_tempdir(), "a b \u00e4")
  withr::local_envvar(R_USER_CACHE_DIR = file.path(folder, "cache"))
  stand_in(file.path(folder, "uv.exe"), "uv 0.12.16")
  archive <- file.path(folder, "download", "uv.zip")
  dir.create(dirname(archive))
  python <- Sys.getenv("GYM_PYTHON", "python3")
  made <- processx::run(python, c("-m", "zipfile", "-c", archive, file.path(folder, "uv.exe")),
                        error_on_status = FALSE)
  skip_if_not(made$status == 0L, "there is no Python that packs a zip file")
  local_windows()
  unpack_uv(archive)
  expect_true(file.exists(pinned_uv()))
  expect_identical(basename(pinned_uv()), "uv.exe")
})
