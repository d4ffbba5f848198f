fake_uv <- function(folder, version = "0.9.0") {
  fake_program(file.path(folder, "uv"), paste0("echo 'uv ", version, " (abc)'"))
}

# uv's release archive, served from a folder, with the checksum that it should have.
local_release <- function(uv, frame = parent.frame()) {
  folder <- withr::local_tempdir(.local_envir = frame)
  name <- paste0("uv-", uv_target())
  dir.create(file.path(folder, name))
  file.copy(uv, file.path(folder, name, "uv"))
  archive <- file.path(folder, paste0(name, ".tar.gz"))
  withr::with_dir(folder, utils::tar(archive, name, compression = "gzip", tar = "internal"))
  withr::local_envvar(UV_DOWNLOAD_URL = paste0("file://", folder), .local_envir = frame)
  release <- uv_release
  release$checksums[[uv_target()]] <- file_sha256(archive)
  local_binding("uv_release", release, frame)
  archive
}

test_that("uv is looked for in the order of the help page", {
  skip_on_os("windows")
  local_cache()
  folder <- withr::local_tempdir()
  reticulate <- fake_uv(file.path(folder, "reticulate"))
  path <- fake_uv(file.path(folder, "path"))
  home <- fake_uv(file.path(folder, "home", ".local", "bin"))
  own <- fake_uv(file.path(tools::R_user_dir("reticulate", "cache"), "uv", "bin"))
  pinned <- fake_uv(dirname(pinned_uv()))
  withr::local_envvar(
    GYM_UV = NA, RETICULATE_UV = reticulate, HOME = file.path(folder, "home"),
    PATH = paste(dirname(path), "/usr/bin", "/bin", sep = ":")
  )
  expect_identical(uv_candidates()[1:2], c(reticulate, path))
  expect_identical(tail(uv_candidates(), 2L), c(own, pinned))
  expect_identical(find_uv(), reticulate)
  # One that is too old, or not uv at all, is passed over.
  fake_uv(dirname(reticulate), "0.6.17")
  expect_identical(find_uv(), path)
  writeLines(c("#!/bin/sh", "echo hello"), path)
  expect_false(find_uv() == path)
  withr::local_envvar(RETICULATE_UV = "managed")
  expect_false("managed" %in% uv_candidates())
})

test_that("one that hangs is passed over, and all are asked within the limit", {
  skip_on_os("windows")
  local_cache()
  folder <- withr::local_tempdir()
  hangs <- fake_program(file.path(folder, "hangs", "uv"), "sleep 60")
  local_binding("uv_candidates", function() c(hangs, fake_uv(file.path(folder, "works"))))
  limits <- numeric()
  local_binding("uv_works", function(uv, timeout) {
    limits <<- c(limits, timeout)
    uv != hangs
  })
  withr::local_envvar(GYM_UV = NA)
  expect_identical(find_uv(within = 3), file.path(folder, "works", "uv"))
  expect_equal(sum(limits), 3)
  find_uv()
  expect_equal(limits[3:4], c(30, 30))
})

test_that("gym_sitrep() soon reports a uv that does not answer", {
  skip_on_os("windows")
  local_cache()
  folder <- withr::local_tempdir()
  hangs <- fake_program(file.path(folder, "uv"), "sleep 60")
  local_binding("uv_candidates", function() hangs)
  withr::local_envvar(GYM_UV = NA)
  asked <- NULL
  real <- run_quietly
  local_binding("run_quietly", function(command, arguments, timeout = 30, ...) {
    asked <<- timeout
    real(command, arguments, 0.5, ...)
  })
  row <- sitrep_uv()
  expect_match(row$finding, paste(hangs, "cannot be used"), fixed = TRUE)
  expect_identical(row$state, "note")
  expect_equal(asked, 3)
})

test_that("a relative path of uv is that of this folder, wherever uv is run", {
  skip_on_os("windows")
  local_cache()
  withr::local_dir(withr::local_tempdir())
  fake_uv("here")
  wanted <- file.path(getwd(), "here", "uv")
  withr::local_envvar(GYM_UV = "here/uv")
  expect_identical(find_uv(), wanted)
  withr::local_envvar(GYM_UV = NA, RETICULATE_UV = "here/uv")
  expect_identical(find_uv(), wanted)
})

test_that("GYM_UV must name a uv that runs", {
  local_cache()
  withr::local_envvar(GYM_UV = "/no/such/uv")
  expect_error(gym_server_install(), "GYM_UV names /no/such/uv", class = "gym_error_install")
})

test_that("the pinned uv has a checksum for each system, and this system a name", {
  expect_match(uv_release$checksums, "^[0-9a-f]{64}$")
  expect_false(anyDuplicated(uv_release$checksums) > 0)
  expect_length(uv_release$checksums, 8L)
  targets <- c(
    "linux-x86_64" = "x86_64-unknown-linux-", "linux-aarch64" = "aarch64-unknown-linux-",
    "darwin-x86_64" = "x86_64-apple-darwin", "darwin-arm64" = "aarch64-apple-darwin",
    "windows-x86_64" = "x86_64-pc-windows-msvc"
  )
  for (system in names(targets)) {
    local_binding("system_name", function() system)
    expect_match(uv_target(), targets[[system]], fixed = TRUE)
    expect_true(uv_target() %in% names(uv_release$checksums))
  }
  local_binding("system_name", function() "sunos-sparc")
  expect_error(install_uv(NULL), "GYM_PYTHON to that Python", class = "gym_error_install")
})

test_that("uv is downloaded, and run only when its checksum is right", {
  skip_on_os("windows")
  local_cache()
  folder <- withr::local_tempdir()
  uv <- fake_uv(folder)
  archive <- local_release(uv)
  expect_message(pinned <- install_uv(NULL), "Downloading uv")
  expect_identical(pinned, pinned_uv())
  expect_true(uv_works(pinned))
  expect_identical(list.files(dirname(pinned)), "uv")
  local_binding("uv_candidates", function() pinned)
  withr::local_envvar(GYM_UV = NA)
  expect_identical(find_uv(), pinned)
  # What does not run any more is downloaded anew.
  writeLines(character(), pinned)
  expect_null(find_uv())
  expect_message(install_uv(NULL), "Downloading uv")
  expect_true(uv_works(pinned))

  unlink(dirname(pinned), recursive = TRUE)
  ran <- file.path(folder, "ran")
  writeLines(c("#!/bin/sh", paste0("touch '", ran, "'"), "echo 'uv 0.9.0'"), uv)
  right <- asNamespace("gym")$uv_release
  local_release(uv)
  # The archive is another than the one whose checksum is known.
  local_binding("uv_release", right)
  expect_error(suppressMessages(install_uv(NULL)), "SHA-256", class = "gym_error_install")
  expect_false(file.exists(ran))
  expect_identical(list.files(install_root(), recursive = TRUE), "install.log")
  # A second try, with the right one.
  withr::local_envvar(UV_DOWNLOAD_URL = paste0("file://", dirname(archive)))
  expect_identical(suppressMessages(install_uv(NULL)), pinned)
})

test_that("a download that fails says what else can be done", {
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  withr::local_envvar(UV_DOWNLOAD_URL = "http://127.0.0.1:9")
  error <- expect_error(suppressMessages(install_uv(NULL)), class = "gym_error_install")
  expect_match(conditionMessage(error), "HTTPS_PROXY", fixed = TRUE)
  expect_match(conditionMessage(error), "by hand", fixed = TRUE)
  expect_match(conditionMessage(error), "-m pip install '?/.*/server'?`, and set GYM_PYTHON to")
})

test_that("a download shows no password, and is not larger than it may be", {
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  withr::local_envvar(UV_DOWNLOAD_URL = "http://me:secret@127.0.0.1:9")
  error <- expect_error(suppressMessages(install_uv(NULL)), class = "gym_error_install")
  expect_match(conditionMessage(error), "http://<login>@127.0.0.1:9/", fixed = TRUE)
  shown <- c(unlist(error), readLines(install_log()))
  expect_false(any(grepl("secret", shown, fixed = TRUE)))
  local_binding("most_bytes_of_uv", 1000)
  archive <- withr::local_tempfile(lines = strrep("x", 5000))
  expect_error(
    download_uv(paste0("file://", archive), withr::local_tempfile(), NULL), "larger than 0.001 MB",
    class = "gym_error_install"
  )
})

test_that("an archive without a uv that runs is refused", {
  skip_on_os("windows")
  local_cache()
  local_release(withr::local_tempfile(lines = "not a program"))
  expect_error(suppressMessages(install_uv(NULL)), "cannot be run", class = "gym_error_install")
  expect_false(file.exists(pinned_uv()))
})
