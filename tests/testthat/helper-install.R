# A cache folder of its own, in which nothing is installed, and no Python or uv but those that the
# tests have anyway. Pythons from the network are not asked for.
local_cache <- function(name = "a caché", frame = parent.frame()) {
  python <- Sys.getenv("GYM_PYTHON")
  folder <- withr::local_tempdir(.local_envir = frame)
  environment <- dirname(dirname(python))
  withr::local_envvar(
    R_USER_CACHE_DIR = file.path(folder, name), GYM_PYTHON = NA, GYM_UV = test_uv(),
    RETICULATE_UV = NA, CONDA_PREFIX = NA, UV_PYTHON_DOWNLOADS = "never",
    UV_PYTHON_INSTALL_DIR = NA,
    VIRTUAL_ENV = if (file.exists(file.path(environment, "pyvenv.cfg"))) environment else NA,
    .local_envir = frame
  )
  file.path(folder, name)
}

# One that is named or found, or that the tests' own environment has.
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
  python <- find_base_python(with_venv = TRUE)
  testthat::skip_if(is.null(python), "no Python 3.10 to 3.13 with venv")
  dir.create(install_root(), recursive = TRUE, showWarnings = FALSE)
  file <- withr::local_tempfile(lines = grep("^blinker", invert = FALSE, value = TRUE, sub(
    " .*", "", readLines(lock_file())
  )))
  reached <- run_tool(python, c(
    "-I", "-m", "pip", "download", "--no-deps", "--no-cache-dir", "--retries", "0", "--timeout",
    "10", "--dest", withr::local_tempdir(), "-r", file
  ))
  testthat::skip_if(failed(reached), "Python's package index is not reached")
}

skip_if_no_uv <- function() {
  testthat::skip_if(is.na(Sys.getenv("GYM_UV", NA)), "no uv (GYM_UV names one)")
}

# An environment as an installation leaves it, but for what is in it.
fake_installation <- function(number = 1L, extras = character(), hash = lock_hash()) {
  # Never into the user's own cache.
  stopifnot(startsWith(install_root(), dirname(tempdir())), nzchar(Sys.getenv("R_USER_CACHE_DIR")))
  folder <- file.path(install_root(), paste0(hash, "-", number))
  site <- if (is_windows()) "venv/Lib/site-packages" else "venv/lib/python3.12/site-packages"
  for (package in c("flask", "numpy")) {
    dir.create(file.path(folder, site, package), recursive = TRUE)
  }
  python <- environment_python(folder)
  fake_program(python)
  write_manifest(folder, extras, call = NULL)
  folder
}

# A program that is a shell script.
fake_program <- function(path, ...) {
  dir.create(dirname(path), recursive = TRUE, showWarnings = FALSE)
  writeLines(c("#!/bin/sh", ...), path)
  Sys.chmod(path, "755")
  path
}

# A uv that fails in a given way.
local_failing_uv <- function(words, frame = parent.frame()) {
  testthat::skip_on_os("windows")
  folder <- withr::local_tempdir(.local_envir = frame)
  uv <- fake_program(
    file.path(folder, "uv"), "if [ \"$1\" = --version ]; then echo 'uv 0.99.0'; exit; fi",
    "cat <<'END'", words, "END", "exit 2"
  )
  withr::local_envvar(GYM_UV = uv, .local_envir = frame)
  uv
}

wait_until <- function(condition) {
  for (i in 1:200) {
    if (condition()) {
      return(invisible(TRUE))
    }
    Sys.sleep(0.1)
  }
  stop("It did not happen.")
}
