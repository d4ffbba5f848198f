# Sets an empty cache folder until the test ends. Only the Python and uv that the tests already use
# are found, and no Python is downloaded.
local_cache <- function(name = "a caché", frame = parent.frame()) {
  python <- Sys.getenv("GYM_PYTHON")
  folder <- withr::local_tempdir(.local_envir = frame)
  environment <- dirname(dirname(python))
  withr::local_envvar(
    R_USER_CACHE_DIR = file.path(folder, name), GYM_PYTHON = NA, GYM_UV = test_uv(),
    RETICULATE_UV = NA, CONDA_PREFIX = NA, UV_PYTHON_DOWNLOADS = "never",
    UV_PYTHON_INSTALL_DIR = NA, UV_PYTHON = NA,
    VIRTUAL_ENV = if (file.exists(file.path(environment, "pyvenv.cfg"))) environment else NA,
    .local_envir = frame
  )
  file.path(folder, name)
}

# The uv that a variable names, that the tests' own environment has, or that is found.
test_uv <- function() {
  beside <- file.path(dirname(Sys.getenv("GYM_PYTHON")), uv_name())
  if (!nzchar(Sys.getenv("GYM_UV")) && file.exists(beside)) {
    return(beside)
  }
  uv <- find_uv()
  if (is.null(uv)) NA else uv
}

skip_if_no_packages <- function() {
  testthat::skip_on_cran()
  skip_if_no_uv()
  dir.create(install_root(), recursive = TRUE, showWarnings = FALSE)
  withr::local_envvar(UV_HTTP_TIMEOUT = "10")
  reached <- run_uv(Sys.getenv("GYM_UV"), c(
    "pip", "install", "--no-cache", "--no-deps", "--target", withr::local_tempdir(),
    "--no-managed-python", "--python", "cpython>=3.10,<3.14", "blinker"
  ))
  testthat::skip_if(reached$failed, "no Python 3.10 to 3.13, or its package index is not reached")
}

skip_if_no_uv <- function() {
  testthat::skip_if(is.na(Sys.getenv("GYM_UV", NA)), "no uv (GYM_UV names one)")
}

# Makes the folders and files of an installation, without its packages.
fake_installation <- function(extras = character(), hash = lock_hash()) {
  # Never write into the user's own cache.
  stopifnot(startsWith(install_root(), dirname(tempdir())), nzchar(Sys.getenv("R_USER_CACHE_DIR")))
  folder <- file.path(install_root(), hash)
  fake_program(environment_python(folder))
  writeLines("", file.path(folder, "venv", "pyvenv.cfg"))
  write_extras(folder, extras)
  folder
}

installed_file <- function(python, name) {
  files <- list.files(dirname(dirname(python)), recursive = TRUE, full.names = TRUE)
  files[endsWith(files, paste0("/site-packages/", name))][[1L]]
}

# A program that is a shell script.
fake_program <- function(path, ...) {
  dir.create(dirname(path), recursive = TRUE, showWarnings = FALSE)
  writeLines(c("#!/bin/sh", ...), path)
  Sys.chmod(path, "755")
  path
}

# A shell script in place of uv. The file `calls` lists the arguments of each call, one call a line.
local_fake_uv <- function(..., frame = parent.frame()) {
  testthat::skip_on_os("windows")
  folder <- withr::local_tempdir(.local_envir = frame)
  uv <- fake_program(
    file.path(folder, "uv"), "if [ \"$1\" = --version ]; then echo 'uv 0.99.0'; exit; fi",
    paste0("echo \"$*\" >> '", file.path(folder, "calls"), "'"), ...
  )
  withr::local_envvar(GYM_UV = uv, .local_envir = frame)
  uv
}

calls_of <- function(uv) readLines(file.path(dirname(uv), "calls"))

# A uv that fails in a given way.
local_failing_uv <- function(words, frame = parent.frame()) {
  local_fake_uv("cat <<'END'", words, "END", "exit 2", frame = frame)
}

wait_until <- function(condition) {
  for (i in 1:3000) {
    if (condition()) {
      return(invisible(TRUE))
    }
    Sys.sleep(0.1)
  }
  stop("It did not happen.")
}
