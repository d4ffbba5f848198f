answering <- function(answer, default) {
  withr::local_options(askYesNo = NULL)
  prompts <- character()
  local_functions(read_answer_line = function(prompt) {
    prompts <<- c(prompts, prompt)
    answer
  })
  value <- ask_yes_no("Start one?", default)
  expect_length(prompts, 1)
  value
}

test_that("yes is yes and no is no, also in part and with blanks", {
  for (answer in c("yes", "y", " YES ", "Ye")) expect_true(answering(answer, default = FALSE))
  for (answer in c("no", "n", "No ")) expect_false(answering(answer, default = TRUE))
})

test_that("just Enter, or a blank line of a script, is the default", {
  expect_true(answering("", default = TRUE))
  expect_true(answering("  ", default = TRUE))
  expect_false(answering("", default = FALSE))
})

test_that("a line of a script is not taken for an answer, nor asked for another", {
  error <- expect_error(
    answering("env_id <- \"CartPole-v0\"", default = TRUE), class = "gym_error_argument"
  )
  expect_match(conditionMessage(error), "CartPole-v0", fixed = TRUE)
  expect_match(conditionMessage(error), "next line of a script", fixed = TRUE)
})

test_that("a front end's own dialog is used where there is one", {
  asked <- NULL
  dialog <- function(answer) {
    function(msg, ...) {
      asked <<- msg
      answer
    }
  }
  withr::local_options(askYesNo = dialog(TRUE))
  expect_true(ask_yes_no("Start one?", default = FALSE))
  expect_identical(asked, "Start one?")
  withr::local_options(askYesNo = dialog(NA))
  expect_false(ask_yes_no("Start one?", default = TRUE))
})

# Addresses -------------------------------------------------------------------------------

# What was opened, and by what.
local_viewers <- function(frame = parent.frame()) {
  opened <- new.env(parent = emptyenv())
  opened$by <- character()
  opens <- function(name) {
    function(address, ...) {
      opened$by <- c(opened$by, name)
      opened$address <- address
    }
  }
  withr::local_options(
    rlang_interactive = TRUE, gym.viewer = NULL, viewer = opens("pane"),
    browser = opens("browser"), .local_envir = frame
  )
  opened$opens <- opens
  opened
}

test_that("the pane shows what is on this machine, the browser the rest", {
  opened <- local_viewers()
  expect_true(open_address("http://127.0.0.1:5000/v1/envs/"))
  expect_true(open_address(tempfile(fileext = ".gif")))
  expect_true(open_address("http://lab.example.org:5000/"))
  expect_identical(opened$by, c("pane", "pane", "browser"))
  withr::local_options(viewer = NULL)
  expect_true(open_address("http://127.0.0.1:5000/v1/envs/"))
  expect_identical(opened$by[[4]], "browser")
})

test_that("nothing is opened in a script, unless the option says so", {
  opened <- local_viewers()
  withr::local_options(rlang_interactive = FALSE)
  expect_false(open_address("http://127.0.0.1:5000/"))
  withr::local_options(gym.viewer = opened$opens("option"))
  expect_true(open_address("http://127.0.0.1:5000/"))
  withr::local_options(rlang_interactive = TRUE, gym.viewer = FALSE)
  expect_false(open_address("http://127.0.0.1:5000/"))
  expect_identical(opened$by, "option")
})

test_that("a browser that fails is none, and the error of the option's own function is shown", {
  fails <- function(address) stop("no display")
  withr::local_options(
    rlang_interactive = TRUE, gym.viewer = NULL, viewer = NULL, browser = fails
  )
  expect_false(open_address("http://127.0.0.1:5000/"))
  withr::local_options(gym.viewer = fails)
  expect_error(open_address("http://127.0.0.1:5000/"), "no display")
})

test_that("the option gym.viewer must make sense", {
  for (bad in list("firefox", TRUE, NA, 1)) {
    withr::local_options(gym.viewer = bad)
    expect_error(open_address("http://127.0.0.1/"), "gym.viewer", class = "gym_error_argument")
  }
})

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
