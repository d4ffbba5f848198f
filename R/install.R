#' Install the server's Python environment
#'
#' Make a Python environment for the server that comes with this package. You do not need to know
#' Python. The environment has exact package versions that were tested together, and each file is
#' compared with a known hash (a fingerprint of its content). Nothing is compiled, and no other
#' Python on the machine is changed.
#'
#' The program [uv](https://docs.astral.sh/uv/) does the work. It is looked for in the environment
#' variables `GYM_UV` and `RETICULATE_UV`, on the `PATH`, in `~/.local/bin` and in reticulate's
#' folder. If there is none, a fixed release is downloaded and checked by its hash. uv also installs
#' its own Python. If the network blocks that, a Python 3.10 to 3.13 on the machine is used. uv's
#' variable `UV_PYTHON` selects another one, by its path or version. If uv is not available, install
#' the packages into a Python by other means and set `GYM_PYTHON` to its path: see
#' `vignette("server")`.
#'
#' The environment is in `tools::R_user_dir("gym", "cache")`, where [gym_client()] finds it. Extras
#' that were installed before are kept. Running servers find new extras. If everything is installed
#' already, the call checks it and says so. It repairs a damaged environment.
#'
#' Set these environment variables by [Sys.setenv()] or in `~/.Renviron` to change sources and
#' targets: `R_USER_CACHE_DIR` is the cache folder, `HTTPS_PROXY` the network's proxy,
#' `SSL_CERT_FILE` the file of its certificates, `UV_PYTHON_INSTALL_MIRROR` the source of Pythons,
#' and `UV_DOWNLOAD_URL` the source of uv. uv also uses its own settings, such as those for an
#' institution's mirror.
#'
#' @param extras Extras to install, a character vector of `"toy-text"`, `"box2d"`, `"mujoco"`,
#'   `"atari"`, `"video"`, `"jax"` (600 MB) and `"sb3"` (Stable-Baselines3 for [learn_sb3()]; with
#'   PyTorch 5.5 GB on Linux with an Intel processor). The default is none. Classic control and toy
#'   text work without extras.
#' @param ... Must be empty.
#' @param offline No longer used. `vignette("server")` shows how to install without a network.
#' @param ask Ask first, showing the packages, the megabytes and the folder? By default `TRUE` in an
#'   interactive session. In a script the call itself is consent.
#' @return The path of the environment's Python, a string, invisibly. `NULL`, invisibly, if the
#'   answer was no.
#' @section Errors: `gym_error_install`, with advice, if the installation failed; an earlier
#'   installation is kept. `gym_error_defunct` for `offline`, `gym_error_argument`.
#' @seealso [gym_client()]
#' @export
#' @examples
#' # Asks in an interactive session:
#' if (interactive()) gym_server_install()
gym_server_install <- function(extras = character(), ..., offline = NULL,
                               ask = rlang::is_interactive()) {
  check_extras(extras)
  check_dots_empty(...)
  if (!is.null(offline)) abort_defunct(without_network, "`offline`")
  check_flag(ask)
  call <- rlang::current_env()
  # Also by an earlier version of the package.
  earlier <- lapply(list.dirs(install_root(), recursive = FALSE), read_extras)
  wanted <- server_extras[server_extras %in% c(extras, unlist(earlier))]
  there <- installed_server()
  if (!is.null(there) && all(wanted %in% there$extras) &&
        is.null(environment_problem(there$python))) {
    cli::cli_inform(c(v = "The server is installed already, in {.path {there$folder}}."))
    return(invisible(there$python))
  }
  uv <- find_uv(call)
  # No by default: an empty line of a pasted script must not start a download.
  if (ask && !ask_yes_no(install_question(wanted, uv), default = FALSE, call = call)) {
    return(invisible())
  }
  dir.create(environment_folder(), recursive = TRUE, showWarnings = FALSE)
  if (!dir.exists(environment_folder())) {
    abort_wrong(NULL, NULL, rlang::current_env(), class = "gym_error_install",
                "The folder {environment_folder()} cannot be made.",
                i = "Check that you can write there and that the disk is not full.",
                i = "The environment variable R_USER_CACHE_DIR sets another place for it.")
  }
  python <- install_environment(wanted, uv %||% fetch_uv(call), call)
  remove_old_folders()
  cli::cli_inform(c(
    v = "Installed in {.path {environment_folder()}}.",
    "!" = if (nzchar(Sys.getenv("GYM_PYTHON"))) {
      "GYM_PYTHON is set and used first; {.code Sys.unsetenv(\"GYM_PYTHON\")} ends that."
    }
  ))
  invisible(python)
}

#' @rdname gym-defunct
#' @export
gym_server_bundle <- function(...) abort_defunct(without_network)

without_network <- paste(
  "copy uv, its Pythons and its cache: see \"A classroom without a network\" in",
  "`vignette(\"server\", package = \"gym\")`"
)

# The sizes of Python and uv are those on Linux with an Intel processor.
install_question <- function(extras, uv) {
  megabytes <- function(key, more) {
    more + sum(as.numeric(sub(" MB", "", lock_entry(extras, key), fixed = TRUE)))
  }
  extras_text <- if (length(extras)) paste0(" (with ", toString(extras), ")")
  paste(
    "The server that plays the environments needs Python packages on this machine.",
    paste0("What:  the games of Gymnasium", extras_text, ", a Python if none is there, by uv ",
           uv %||% paste(uv_release$version, "(which is downloaded)")),
    sprintf("Size:  at most %.0f MB to download, %.0f MB on the disk", megabytes("download", 55),
            megabytes("disk", 150)),
    paste("Where:", install_root()), "Install them?", sep = "\n"
  )
}

# Sessions that install at the same time use the same folder: uv makes one wait for the other, which
# then finds everything there.
install_environment <- function(extras, uv, call) {
  folder <- environment_folder()
  python <- environment_python(folder)
  cli::cli_inform(c(i = "Installing the server's packages. This can take some minutes."))
  if (!has_venv(folder)) make_venv(uv, folder, call)
  # Files may be missing from packages that uv considers installed.
  for (repairs in list(NULL, "--reinstall")) {
    output <- run_uv(uv, c(
      # With bytecode a server starts three times as fast.
      "pip", "sync", "--python", python, "--require-hashes", "--no-build", "--compile-bytecode",
      repairs, lock_files(extras)
    ))
    if (output$failed) abort_uv("The server's packages could not be installed", output, call)
    problem <- environment_problem(python)
    if (is.null(problem)) {
      write_extras(folder, extras)
      return(python)
    }
  }
  output$text <- problem
  abort_uv("The packages are installed, but the server cannot be run with them", output, call)
}

# Without pyvenv.cfg, uv would take this Python for the environment's base and install the packages
# there.
has_venv <- function(folder) {
  code <- "import sys; print((3, 10) <= sys.version_info < (3, 14))"
  file.exists(file.path(folder, "venv", "pyvenv.cfg")) &&
    startsWith(run_quietly(environment_python(folder), c("-I", "-c", code))$stdout, "True")
}

# A Python that uv installs; on a network that blocks those, one of this machine.
make_venv <- function(uv, folder, call) {
  venv <- function(...) {
    run_uv(uv, c("venv", "--allow-existing", ..., file.path(folder, "venv")))
  }
  if (nzchar(Sys.getenv("UV_PYTHON"))) {
    output <- venv()
  } else {
    output <- venv("--managed-python", "--python", "3.12")
    if (output$failed) {
      other <- venv("--no-managed-python", "--no-python-downloads", "--python",
                    "cpython>=3.10,<3.14")
      if (!other$failed) output <- other
    }
  }
  if (output$failed || !has_venv(folder)) {
    abort_uv("uv could neither install nor find a Python for the server", output, call, c(
      i = paste("Install a 64-bit Python 3.10 to 3.13 and call `gym_server_install()` again; or",
                "set UV_PYTHON_INSTALL_MIRROR to a place from which uv can get its Pythons."),
      i = if (nzchar(Sys.getenv("UV_PYTHON"))) "`Sys.unsetenv(\"UV_PYTHON\")` lets uv choose."
    ))
  }
}

# Why an environment is not as it was installed, a string, or NULL. Each installed file must be
# there, and the server must run.
environment_problem <- function(python) {
  python_problem(python, before = paste(
    "import csv, importlib.metadata as metadata, sysconfig",
    "for package in metadata.distributions(path=[sysconfig.get_path('purelib')]):",
    "    for file, *_ in csv.reader((package.read_text('RECORD') or '').splitlines()):",
    "        if not package.locate_file(file).exists(): raise SystemExit(f'{file} is missing')\n",
    sep = "\n"
  ))
}

#' Install the server's Python environment if the user agrees
#'
#' The user agrees by the environment variable GYM_INSTALL, or when asked now. A session that
#' declined is not asked again.
#' @return The path of the environment's Python, or `NULL` without consent.
#' @noRd
prompt_for_python <- function() {
  if (tolower(Sys.getenv("GYM_INSTALL")) %in% c("1", "true", "yes")) {
    return(keep_random_state(gym_server_install(ask = FALSE)))
  }
  if (!rlang::is_interactive() || isTRUE(the_session$install_declined)) {
    return(NULL)
  }
  # Process names are drawn from R's generator.
  python <- keep_random_state(gym_server_install(ask = TRUE))
  the_session$install_declined <- is.null(python)
  python
}
