fake_bundle <- function(..., frame = parent.frame()) {
  dir <- withr::local_tempdir(.local_envir = frame)
  fields <- utils::modifyList(list(
    System = bundle_system(), Lock = lock_hash(), Extras = "box2d", Python = "3.12",
    Brings = "packages"
  ), list(...))
  write.dcf(fields, file.path(dir, "bundle.dcf"))
  dir
}

test_that("a bundle installs without a network", {
  local_cache()
  skip_if_no_packages()
  dir <- file.path(withr::local_tempdir(), "a bündle")
  suppressMessages(expect_message(
    expect_identical(gym_server_bundle(dir, "box2d"), normalizePath(dir)), "The bundle is ready"
  ))
  expect_true(all(list.files(dir) %in% c("bundle.dcf", "wheels", "lock", "uv", "python")))
  # Anybody else's folder stays as it is.
  writeLines("", file.path(dir, "thesis.txt"))
  expect_error(gym_server_bundle(dir), "empty folder", class = "gym_error_argument")

  # The other machine: no network, no packages from before, no uv but the bundle's.
  local_cache("another")
  withr::local_envvar(
    HTTPS_PROXY = "http://127.0.0.1:9", UV_CACHE_DIR = withr::local_tempdir(),
    PIP_NO_CACHE_DIR = "1", GYM_UV = NA
  )
  python <- suppressMessages(gym_server_install("box2d", offline = dir))
  expect_identical(installed_server(), list(
    python = python, folder = dirname(dirname(dirname(python))), extras = "box2d"
  ))
  expect_match(readLines(install_log()), "--no-index", all = FALSE)
  expect_error(gym_server_install("atari", offline = dir), "lacks \"atari\"",
               class = "gym_error_install")
})

test_that("a bundle for something else says so", {
  local_cache()
  refused <- function(..., words) {
    expect_error(gym_server_install("box2d", offline = fake_bundle(...)), words,
                 class = "gym_error_install")
  }
  refused(System = "windows-riscv", words = "another system, windows-riscv")
  refused(Lock = "0123456789ab", words = "another version of this package")
  refused(Extras = "atari", words = "lacks \"box2d\"")
  refused(Python = "3.7", words = "for Python 3.7 and brings none")
  expect_error(gym_server_install(offline = withr::local_tempdir()), "no whole bundle",
               class = "gym_error_install")
  expect_false(dir.exists(file.path(install_root(), "installing")))
})
