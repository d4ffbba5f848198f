fake_bundle <- function(..., frame = parent.frame()) {
  dir <- withr::local_tempdir(.local_envir = frame)
  fields <- utils::modifyList(list(
    System = bundle_system(), Lock = lock_hash(), Extras = "box2d", Python = "3.12",
    Index = "--default-index https://index.example/simple"
  ), list(...))
  write.dcf(fields, file.path(dir, "bundle.dcf"))
  writeLines(character(), file.path(dir, "SHA256SUMS"))
  dir
}

test_that("a bundle installs without a network", {
  skip_unless_all()
  local_cache()
  skip_if_no_packages()
  dir <- file.path(withr::local_tempdir(), "a bündle")
  suppressMessages(expect_message(
    expect_identical(gym_server_bundle(dir, "box2d"), dir), "The bundle is ready"
  ))
  expect_setequal(list.files(dir), c("bundle.dcf", "SHA256SUMS", uv_name(), "cache"))
  expect_identical(list.files(install_root()), "install.log")
  # Any other folder stays as it is.
  writeLines("", file.path(dir, "thesis.txt"))
  expect_error(gym_server_bundle(dir), "empty folder", class = "gym_error_argument")

  # On the way: no links, and no file is a program any more.
  files <- list.files(dir, recursive = TRUE, include.dirs = TRUE, full.names = TRUE)
  expect_true(all(Sys.readlink(files) %in% c("", NA)))
  Sys.chmod(list.files(dir, recursive = TRUE, full.names = TRUE), "644")
  # The other machine: no network, no packages from before, no uv but the bundle's, an index of
  # its own.
  local_cache("another")
  withr::local_envvar(
    HTTPS_PROXY = "http://127.0.0.1:9", UV_CACHE_DIR = withr::local_tempdir(), UV_NO_CACHE = "1",
    GYM_UV = NA, UV_DEFAULT_INDEX = "https://mirror.example/simple"
  )
  withr::local_dir(dirname(dir))
  python <- suppressMessages(gym_server_install("box2d", offline = basename(dir)))
  expect_identical(installed_server(), list(
    python = python, folder = dirname(dirname(dirname(python))), extras = "box2d"
  ))
  expect_match(readLines(install_log()), "--offline", all = FALSE)
  expect_error(gym_server_install("atari", offline = dir), "lacks \"atari\"",
               class = "gym_error_install")
  # A file that was deleted comes from the bundle again.
  typed <- installed_file(python, "flask/py.typed")
  unlink(typed)
  suppressMessages(gym_server_install("box2d", offline = basename(dir)))
  expect_true(file.exists(typed))
})

test_that("a bundle is of the indexes that were used, and shows no password", {
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  uv <- local_fake_uv(
    "echo --index-url https://me:secret@index.example/simple",
    "echo --extra-index-url https://me:secret@more.example/simple"
  )
  expect_identical(index_arguments(list(uv = uv), "python"), c(
    "--default-index https://index.example/simple",
    "--extra-index-url https://more.example/simple"
  ))
  expect_false(any(grepl("secret", readLines(install_log()), fixed = TRUE)))
  dir <- fake_bundle()
  expect_identical(read_bundle(dir, "box2d", NULL)$index,
                   c("--default-index", "https://index.example/simple"))
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

test_that("an earlier bundle stays until the new one is complete", {
  skip_unless_all()
  local_cache()
  dir <- fake_bundle()
  dir.create(file.path(dir, "cache"))
  writeLines("", file.path(dir, "cache", "a"))
  before <- list.files(dir, recursive = TRUE)
  withr::local_envvar(GYM_UV = "/no/such/uv")
  expect_error(gym_server_bundle(dir), "GYM_UV", class = "gym_error_install")
  local_failing_uv("error: Failed to fetch")
  expect_error(
    suppressMessages(gym_server_bundle(dir)), "network is unavailable", class = "gym_error_install"
  )
  expect_identical(list.files(dir, recursive = TRUE), before)
  expect_identical(list.files(install_root()), "install.log")

  new <- withr::local_tempdir()
  writeLines("new", file.path(new, "uv"))
  write_sums(new)
  replace_bundle(new, dir, list(Complete = "yes"), NULL)
  expect_setequal(list.files(dir, recursive = TRUE), c("bundle.dcf", "SHA256SUMS", "uv"))
  # One that broke off is none, and is replaced, too.
  writeLines("newer", file.path(new, "uv"))
  expect_error(replace_bundle(new, dir, list(), NULL), "not what SHA256SUMS lists")
  expect_error(read_bundle(dir, "box2d", NULL), "no complete bundle", class = "gym_error_install")
  expect_silent(check_bundle_place(dir, NULL))
})

test_that("a uv that runs in its own folder only is no part of a bundle", {
  skip_on_os("windows")
  local_cache()
  folder <- withr::local_tempdir()
  uv <- fake_program(
    file.path(folder, "uv"), "[ -e \"$(dirname \"$0\")/real\" ] && echo 'uv 0.99.0'"
  )
  writeLines("", file.path(folder, "real"))
  withr::local_envvar(GYM_UV = uv)
  expect_error(
    suppressMessages(gym_server_bundle(withr::local_tempdir())), "another folder",
    class = "gym_error_install"
  )
})

bundle_with_uv <- function(..., frame = parent.frame()) {
  dir <- fake_bundle(frame = frame)
  uv <- fake_program(file.path(dir, "uv"), ...)
  writeLines(paste0(file_sha256(uv), "  uv"), file.path(dir, "SHA256SUMS"))
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

test_that("what was changed on the way is not run", {
  skip_on_os("windows")
  local_cache()
  ran <- withr::local_tempfile()
  dir <- bundle_with_uv(paste0("touch '", ran, "'"))
  cat("# changed\n", file = file.path(dir, "uv"), append = TRUE)
  expect_error(
    suppressMessages(gym_server_install("box2d", offline = dir)), "was not run: uv is not what",
    class = "gym_error_install"
  )
  unlink(file.path(dir, "uv"))
  expect_error(
    suppressMessages(gym_server_install("box2d", offline = dir)), "was not run: uv is not what",
    class = "gym_error_install"
  )
  expect_false(file.exists(ran))
  expect_setequal(list.files(install_root()), c("install.log", lock_hash()))
})

test_that("a bundle's uv and Python are used, and settings of the machine are not", {
  skip_on_os("windows")
  local_cache()
  withr::local_envvar(UV_PYTHON = "/my/python")
  calls <- withr::local_tempfile()
  dir <- bundle_with_uv(
    paste0("echo \"$* $UV_NO_CONFIG<$UV_INDEX>\" >> '", calls, "'"), "[ \"$1\" = venv ]"
  )
  withr::local_envvar(UV_INDEX = "https://else.example")
  expect_error(
    suppressMessages(gym_server_install("box2d", offline = dir)), "could not be installed",
    class = "gym_error_install"
  )
  expect_match(readLines(calls)[1L], "--managed-python --python 3.12 .* 1<>$")
  expect_match(readLines(calls)[2L], "--offline --default-index https://index.example/simple .*<>$")
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
  expect_error(gym_server_install(offline = withr::local_tempdir()), "no complete bundle",
               class = "gym_error_install")
  expect_false(dir.exists(install_root()))
})
