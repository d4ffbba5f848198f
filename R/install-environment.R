# Making the environment: uv creates it from a Python and installs the packages of the lock files.
# Then comes a trial run; the manifest is written last. Sessions that install at the same time use
# the same folder: uv makes one wait for the other, which then finds everything there.

install_environment <- function(plan, call) {
  started <- Sys.time()
  folder <- environment_folder()
  make_folder(folder, call)
  write_log(c("", paste("##", format(started), "gym", utils::packageVersion("gym"))))
  cli::cli_inform(c(i = "Installing {describe_plan(plan)}: {describe_download(plan)}."))
  source <- if (is.null(plan$bundle)) {
    network_source(plan$uv %||% install_uv(call))
  } else {
    copy <- tempfile("bundle-", install_root())
    on.exit(unlink(copy, recursive = TRUE))
    copy_bundle(plan$bundle$dir, copy, call)
    bundle_source(copy, plan$bundle)
  }
  make_environment(folder, source, plan$extras, call)
  write_extras(folder, plan$extras, call)
  remove_old_folders()
  seconds <- as.numeric(difftime(Sys.time(), started, units = "secs"))
  cli::cli_inform(c(v = "Installed in {ceiling(seconds)} s, in {.path {folder}}."))
  environment_python(folder)
}

#' Where uv downloads from and writes to
#' @return A list: `uv`, its path; `python`, the version that it installs; `other_python`, which of
#'   the machine's Pythons to use if it cannot; `named_python`, the user's choice, or `NULL`;
#'   `only_python`, the version that the environment must have, `NULL` for any; `arguments`, further
#'   ones for installing packages; `env`, environment variables.
#' @noRd
network_source <- function(uv) {
  list(
    uv = uv, python = managed_python_version, other_python = "cpython>=3.10,<3.14",
    named_python = chosen_python(), env = managed_python_place()
  )
}

managed_python_version <- "3.12"

# UV_PYTHON is a variable of uv: a path or a version.
chosen_python <- function() {
  named <- Sys.getenv("UV_PYTHON")
  if (nzchar(named)) named
}

make_environment <- function(folder, source, extras, call) {
  if (!has_venv(folder, source$only_python)) {
    make_venv(folder, source, call)
  }
  install_packages(folder, source, extras, call)
  trial <- try_environment(environment_python(folder), extras)
  if (failed(trial)) {
    # Files may be missing from packages that uv considers installed.
    install_packages(folder, source, extras, call, "--reinstall")
    trial <- try_environment(environment_python(folder), extras)
  }
  if (failed(trial)) {
    abort_tool("The packages are installed, but the server cannot be run with them", trial, call)
  }
}

# Whether there is an environment with a Python that fits the lock files and the version. Without
# pyvenv.cfg, uv would take this Python for the environment's base and install the packages there.
has_venv <- function(folder, version = NULL) {
  python <- environment_python(folder)
  about <- if (file.exists(file.path(folder, "venv", "pyvenv.cfg"))) probe_python(python)
  isTRUE(about$fits) && about$version == (version %||% about$version)
}

install_packages <- function(folder, source, extras, call, ...) {
  output <- run_tool(source$uv, c(
    "pip", "sync", "--python", environment_python(folder), "--require-hashes", "--no-build", ...,
    source$arguments, lock_files(extras)
  ), source$env)
  if (failed(output)) {
    abort_tool("The server's packages could not be installed", output, call)
  }
}

make_venv <- function(folder, source, call) {
  venv <- function(...) {
    run_tool(source$uv, c("venv", "--allow-existing", ..., file.path(folder, "venv")), source$env)
  }
  if (!is.null(source$named_python)) {
    output <- venv("--python", source$named_python)
    if (failed(output) || !has_venv(folder)) {
      abort_tool(
        paste("No environment could be made with the Python that UV_PYTHON names,",
              source$named_python),
        output, call, more = paste(
          "It must be a 64-bit Python 3.10 to 3.13; after `Sys.unsetenv(\"UV_PYTHON\")`",
          "uv installs one."
        )
      )
    }
    return(invisible())
  }
  output <- venv("--managed-python", "--python", source$python)
  if (!failed(output)) {
    return(invisible())
  }
  # Many networks block the server with uv's own Pythons.
  other <- venv("--no-managed-python", "--no-python-downloads", "--python", source$other_python)
  if (failed(other)) {
    abort_tool(
      paste0("uv could not install Python ", source$python,
             ", and found no suitable one on this machine (", source$other_python, ")"),
      output, call,
      more = paste(
        "Install one of these and call `gym_server_install()` again; or set",
        "UV_PYTHON_INSTALL_MIRROR to a place from which uv can get its Pythons."
      )
    )
  }
  cli::cli_inform(c(
    i = "uv could not install its own Python and uses one on this machine.",
    " " = grep("^Using ", other, value = TRUE)[1L],
    " " = "The reason is in {.path {install_log()}}."
  ))
}

# uv's Pythons are beside the environments, so that they are removed together, and on Windows
# outside the roaming profile.
managed_python_place <- function() {
  place <- Sys.getenv("UV_PYTHON_INSTALL_DIR")
  c(UV_PYTHON_INSTALL_DIR = if (nzchar(place)) place else managed_python_folder(), not_registered)
}

managed_python_folder <- function() file.path(install_root(), "python")

# Keep uv from adding a command to the PATH or an entry to the registry.
not_registered <- c(UV_PYTHON_INSTALL_BIN = "0", UV_PYTHON_INSTALL_REGISTRY = "0")

# Imports the server as it will be run, looks for the extras' modules, and checks that each
# installed file is still there. The exit status alone is not enough: a Python that is an empty file
# has the exit status 0, too.
try_environment <- function(python, extras) {
  modules <- extra_modules[names(extra_modules) %in% extras]
  script <- c(
    "import csv, importlib.metadata, importlib.util",
    "import gym_server.cli.main, gymnasium.envs.classic_control, pygame",
    sprintf("if not importlib.util.find_spec('%s'): raise SystemExit('%s is missing')",
            modules, modules),
    "for package in importlib.metadata.distributions():",
    "    for file, *_ in csv.reader((package.read_text('RECORD') or '').splitlines()):",
    "        if not package.locate_file(file).exists(): raise SystemExit(f'{file} is missing')",
    sprintf("print('%s')", it_runs)
  )
  output <- run_tool(python, c("-c", paste(script, collapse = "\n")), env = c(
    PYTHONPATH = system.file("server", package = "gym"), PYTHONDONTWRITEBYTECODE = "1",
    PYGAME_HIDE_SUPPORT_PROMPT = "1"
  ))
  if (!failed(output) && !it_runs %in% trimws(output)) {
    attr(output, "status") <- -1L
  }
  output
}

it_runs <- "gym_server can be run"
