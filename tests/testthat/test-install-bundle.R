fake_bundle <- function(..., frame = parent.frame()) {
  dir <- withr::local_tempdir(.local_envir = frame)
  fields <- utils::modifyList(list(
    System = bundle_system(), Lock = lock_hash(), Extras = "box2d", Python = "3.12",
    Contains = "packages", UvHash = "none"
  ), list(...))
  write.dcf(fields, file.path(dir, "bundle.dcf"))
  dir
}

test_that("a bundle installs without a network", {
  skip_unless_all()
  local_cache()
  skip_if_no_packages()
  dir <- file.path(withr::local_tempdir(), "a bündle")
  suppressMessages(expect_message(
    expect_identical(gym_server_bundle(dir, "box2d"), normalizePath(dir)), "The bundle is ready"
  ))
  expect_true(all(list.files(dir) %in% c("bundle.dcf", "wheels", "lock", "uv", "python")))
  # Any other folder stays as it is.
  writeLines("", file.path(dir, "thesis.txt"))
  expect_error(gym_server_bundle(dir), "empty folder", class = "gym_error_argument")

  # The other machine: no network, no packages from before, no uv but the bundle's.
  local_cache("another")
  withr::local_envvar(
    HTTPS_PROXY = "http://127.0.0.1:9", UV_CACHE_DIR = withr::local_tempdir(),
    PIP_NO_CACHE_DIR = "1", GYM_UV = NA
  )
  withr::local_dir(dirname(dir))
  python <- suppressMessages(gym_server_install("box2d", offline = basename(dir)))
  expect_identical(installed_server(), list(
    python = python, folder = dirname(dirname(dirname(python))), extras = "box2d"
  ))
  expect_match(readLines(install_log()), "--no-index", all = FALSE)
  expect_error(gym_server_install("atari", offline = dir), "lacks \"atari\"",
               class = "gym_error_install")
})

test_that("a folder that only looks like a bundle stays as it is", {
  local_cache()
  dir <- withr::local_tempdir()
  dir.create(file.path(dir, "python"))
  writeLines("print('mine')", file.path(dir, "python", "mine.py"))
  expect_error(gym_server_bundle(dir), "earlier bundle", class = "gym_error_argument")
  expect_true(file.exists(file.path(dir, "python", "mine.py")))
  file <- withr::local_tempfile(lines = "mine")
  expect_error(gym_server_bundle(file), "earlier bundle", class = "gym_error_argument")
  expect_identical(readLines(file), "mine")
})

test_that("an earlier bundle stays until it is clear how a new one can be made", {
  local_cache()
  withr::local_envvar(GYM_UV = "/no/such/uv")
  dir <- fake_bundle()
  dir.create(file.path(dir, "wheels"))
  writeLines("", file.path(dir, "wheels", "a.whl"))
  expect_error(gym_server_bundle(dir), "GYM_UV", class = "gym_error_install")
  expect_setequal(list.files(dir, recursive = TRUE), c("bundle.dcf", "wheels/a.whl"))

  empty_bundle(dir, NULL)
  expect_identical(list.files(dir), "making")
  # As does one that broke off.
  writeLines("", file.path(dir, "making", "half"))
  expect_error(empty_bundle(dir, NULL), NA)
  expect_identical(list.files(dir, recursive = TRUE), character())
})

bundle_with_uv <- function(..., hash = NULL, frame = parent.frame()) {
  uv <- fake_program(withr::local_tempfile(), ...)
  dir <- fake_bundle(Contains = "uv and Python", UvHash = hash %||% file_sha256(uv), frame = frame)
  dir.create(file.path(dir, "uv"))
  file.copy(uv, file.path(dir, "uv", "uv"))
  dir
}

test_that("nothing of a bundle is copied before the answer is yes", {
  skip_on_os("windows")
  local_cache()
  asked <- character()
  local_binding("ask_yes_no", function(question, ...) {
    asked <<- question
    FALSE
  })
  dir <- bundle_with_uv("echo 'uv 0.99.0'")
  expect_null(gym_server_install("box2d", offline = dir, ask = TRUE))
  expect_match(asked, "the bundle's uv", fixed = TRUE)
  expect_false(dir.exists(install_root()))
})

test_that("a bundle's uv that was changed on the way is not run", {
  skip_on_os("windows")
  local_cache()
  ran <- withr::local_tempfile()
  dir <- bundle_with_uv(paste0("touch '", ran, "'"), hash = strrep("0", 64))
  expect_error(
    suppressMessages(gym_server_install("box2d", offline = dir)), "was not run",
    class = "gym_error_install"
  )
  expect_false(file.exists(ran))
  expect_identical(list.files(file.path(install_root(), "uv", "bundle")), character())
})

test_that("where a bundle's uv does not run another is taken", {
  skip_on_os("windows")
  local_cache()
  uv <- local_failing_uv("error: Failed to fetch")
  dir.create(install_root(), recursive = TRUE)
  works <- bundle_plan(bundle_with_uv("echo 'uv 0.99.0'"), "box2d", NULL)
  expect_identical(copy_bundled_uv(works, NULL), works)
  expect_true(uv_works(works$tool))
  broken <- bundle_plan(bundle_with_uv("exit 1"), "box2d", NULL)
  expect_identical(broken$tool, bundled_uv())
  expect_identical(copy_bundled_uv(broken, NULL)$tool, uv)
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
  refused(Python = "3.7", words = "for Python 3.7 and contains none")
  expect_error(gym_server_install(offline = withr::local_tempdir()), "no complete bundle",
               class = "gym_error_install")
  expect_false(dir.exists(file.path(install_root(), "installing")))
})
