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
  expect_error(fetch_uv(NULL), "GYM_PYTHON to that Python", class = "gym_error_install")
})

test_that("uv is downloaded, and run only when its checksum is right", {
  skip_on_os("windows")
  local_cache()
  folder <- withr::local_tempdir()
  uv <- fake_uv(folder)
  archive <- local_release(uv)
  expect_message(pinned <- fetch_uv(NULL), "Downloading uv")
  expect_identical(pinned, pinned_uv())
  expect_identical(list.files(dirname(pinned)), "uv")
  local_binding("uv_candidates", function() pinned)
  withr::local_envvar(GYM_UV = NA)
  expect_identical(find_uv(), pinned)
  # What does not run any more is downloaded anew.
  writeLines(character(), pinned)
  expect_null(find_uv())
  suppressMessages(fetch_uv(NULL))
  expect_true(uv_works(pinned))

  unlink(dirname(pinned), recursive = TRUE)
  ran <- file.path(folder, "ran")
  writeLines(c("#!/bin/sh", paste0("touch '", ran, "'"), "echo 'uv 0.9.0'"), uv)
  right <- asNamespace("gym")$uv_release
  local_release(uv)
  # The archive is another than the one whose checksum is known.
  local_binding("uv_release", right)
  expect_error(suppressMessages(fetch_uv(NULL)), "SHA-256", class = "gym_error_install")
  expect_false(file.exists(ran))
  expect_false(file.exists(pinned))
})

test_that("a download that fails says what else can be done, and shows no password", {
  local_cache()
  withr::local_envvar(UV_DOWNLOAD_URL = "http://me:secret@127.0.0.1:9")
  error <- expect_error(suppressMessages(fetch_uv(NULL)), class = "gym_error_install")
  message <- conditionMessage(error)
  expect_match(message, "http://<login>@127.0.0.1:9/", fixed = TRUE)
  expect_match(message, "HTTPS_PROXY", fixed = TRUE)
  expect_match(message, "by hand", fixed = TRUE)
  expect_match(message, "-m pip install '?/.*/server'?`, and set GYM_PYTHON to")
  expect_false(any(grepl("secret", unlist(error), fixed = TRUE)))
})

test_that("an archive without a uv that runs is refused", {
  skip_on_os("windows")
  local_cache()
  local_release(withr::local_tempfile(lines = "not a program"))
  expect_error(suppressMessages(fetch_uv(NULL)), "cannot be run", class = "gym_error_install")
})

test_that("uv gets nothing of another Python's, and shows no password", {
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  withr::local_envvar(PYTHONPATH = "/else", PYTHONHOME = "/else", VIRTUAL_ENV = "/else")
  uv <- local_fake_uv("echo \"<$PYTHONPATH$PYTHONHOME$VIRTUAL_ENV> $UV_PYTHON_INSTALL_DIR\"",
                      "echo https://me:secret@index.example >&2; exit 3")
  output <- run_uv(uv, "x")
  expect_true(output$failed)
  expect_identical(output$text, paste0("<> ", install_root(),
                                       "/python\nhttps://<login>@index.example\n"))
  expect_true(run_uv("/no/such/tool", "x")$failed)
})

test_that("a failure says what to do, with the lines that name it", {
  advice <- function(...) install_advice(paste(c(...), collapse = "\n"))
  # The words are those of uv 0.13.9.
  expect_match(advice(
    "error: Failed to install: numpy-2.5.5-cp312-cp312-manylinux_2_28_x86_64.whl (numpy==2.5.5)",
    "cause: failed to copy file: No space left on device (os error 28)"
  ), "disk is full")
  expect_match(advice(
    "error: Failed to fetch: `https://index.example/simple/blinker/`",
    "cause: client error (Connect)", "cause: invalid peer certificate: UnknownIssuer"
  ), "SSL_CERT_FILE")
  expect_match(advice(
    "cause: tunnel error: failed to create underlying connection", "cause: tcp connect error"
  ), "HTTPS_PROXY")
  expect_match(advice(
    "cause: dns error", "cause: failed to lookup address information: Name or service not known"
  ), "without a network")
  expect_match(advice(
    "error: No solution found when resolving dependencies:",
    "cause: Because numpy==2.5.5 has no wheels with a matching Python ABI tag (e.g., `cp39`)"
  ), "Python 3.10")
  expect_match(advice(
    "error: Hash mismatch for `blinker==1.9.0`", "Expected:", "  sha256:0", "Computed:"
  ), "refused")
  expect_null(advice("something else"))

  refusal <- function(...) {
    text <- paste(c(...), collapse = "\n")
    expect_error(abort_uv("It failed", list(text = text), NULL), class = "gym_error_install")
  }
  error <- refusal("Resolved 14 packages", "error: Failed to fetch", "cause: dns error", "")
  expect_match(conditionMessage(error), "It failed[.]\n. error: Failed to fetch\ncause: dns")
  expect_identical(error$output[[1L]], "Resolved 14 packages")
  expect_match(conditionMessage(refusal(letters)), "u\nv\nw\nx\ny\nz\n", fixed = TRUE)
})
