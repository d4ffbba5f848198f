# Planning an installation: with which tool, for which Python, how many megabytes.

#' Plan an installation
#'
#' Nothing is changed and nothing downloaded.
#' @param extras All extras that the environment will hold.
#' @return A list: `how`, `"uv"` (with the uv found), `"python"` (a Python's venv and pip) or
#'   `"download"` (uv itself is downloaded first); `tool`, the path of the uv or the Python,
#'   `NULL` for a download; `megabytes`, about how much is downloaded and how much it takes on
#'   the disk, a numeric vector with the names `download` and `disk`; `extras`.
#' @noRd
install_plan <- function(extras = character(), call = rlang::caller_env()) {
  uv <- find_uv(call)
  python <- if (is.null(uv)) find_base_python(with_venv = TRUE)
  how <- if (!is.null(uv)) "uv" else if (!is.null(python)) "python" else "download"
  megabytes <- lock_megabytes(extras)
  if (how != "python" && !has_managed_python()) {
    megabytes <- megabytes + managed_python_megabytes
  }
  megabytes <- megabytes + switch(how, download = uv_megabytes, python = pip_megabytes, 0)
  list(
    how = how, tool = if (is.null(uv)) python else uv, megabytes = megabytes, extras = extras
  )
}

# Approximate sizes on Linux with an Intel processor: of the Python that uv installs, and of the uv
# that R/install-uv.R names.
managed_python_megabytes <- c(download = 35, disk = 110)
uv_megabytes <- c(download = 20, disk = 40)

# pip itself, and the bytecode that it compiles.
pip_megabytes <- c(download = 0, disk = 50)

managed_python_version <- "3.12"

managed_python_folder <- function() file.path(install_root(), "python")

has_managed_python <- function() {
  start <- paste0("^cpython-", gsub(".", "[.]", managed_python_version, fixed = TRUE))
  length(list.files(managed_python_folder(), start)) > 0L
}

# Finds a Python on this machine that an environment can be made from; NULL when there is none. If
# uv makes the environment, the Python needs no venv and pip, which Debian packages separately.
find_base_python <- function(with_venv, versions = lock_pythons) {
  Find(function(python) {
    about <- probe_python(python)
    isTRUE(about$fits) && about$version %in% versions && (about$venv || !with_venv)
  }, Filter(Negate(is_installed_python), python_candidates()))
}

# Asks a Python for its version, whether the lock files are for it, and whether it can make
# environments. Returns NULL for a Python that does not run.
probe_python <- function(python) {
  output <- ask_program(
    python, c("-I", "-c", probe), timeout = 60, env = tool_environment()
  )$stdout
  words <- strsplit(trimws(output), " ", fixed = TRUE)[[1L]]
  if (length(words) != 5L || words[[1L]] != "python") {
    return(NULL)
  }
  version <- words[[2L]]
  list(
    version = version,
    fits = version %in% lock_pythons && words[[3L]] == "CPython" && words[[4L]] == "64",
    venv = words[[5L]] == "venv"
  )
}

lock_pythons <- c("3.10", "3.11", "3.12", "3.13")

# What probe_python() runs. It is run with -I, which every Python that the server can use knows.
probe <- paste(
  "import platform, sys",
  "try:",
  "    import ensurepip, venv",
  "    found = 'venv'",
  "except ImportError:",
  "    found = '-'",
  "print('python', '%d.%d' % sys.version_info[:2], platform.python_implementation(),",
  "      64 if sys.maxsize > 2**32 else 32, found)",
  sep = "\n"
)
