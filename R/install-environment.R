# Making an environment, in a folder of its own: a Python, the packages of the lock files, a trial,
# and the manifest at the end.

install_environment <- function(plan, call) {
  started <- Sys.time()
  write_log(c("", paste("##", format(started), "gym", utils::packageVersion("gym"), plan$how)))
  folder <- make_folder(call)
  complete <- FALSE
  on.exit(end_folder(folder, complete))
  plan <- copy_bundled_uv(plan, call)
  cli::cli_inform(c(i = "Installing {describe_plan(plan)}: {describe_download(plan)}."))
  uv <- if (plan$how == "download") install_uv(call) else if (plan$how == "uv") plan$tool
  make_environment(folder, uv, plan, call)
  install_packages(folder, uv, plan, call)
  python <- environment_python(folder)
  trial <- try_environment(python, plan$extras)
  if (failed(trial)) {
    abort_tool("The packages are installed, but the server cannot be run with them", trial, call)
  }
  write_manifest(folder, plan$extras, call)
  complete <- TRUE
  remove_other_folders(keep = folder)
  seconds <- as.numeric(difftime(Sys.time(), started, units = "secs"))
  cli::cli_inform(c(v = "Installed in {ceiling(seconds)} s, in {.path {folder}}."))
  python
}

make_environment <- function(folder, uv, plan, call) {
  if (is.null(uv)) {
    return(make_venv(plan$tool, c("-I", "-m", "venv"), plan$tool, folder, call))
  }
  if (is.null(plan$base_python)) {
    output <- run_tool(
      uv, c("venv", "--managed-python", "--python", managed_python_version, venv_folder(folder)),
      env = c(managed_python_place(), bundled_python_place(plan$bundle))
    )
    if (!failed(output)) {
      return(invisible())
    }
    plan$base_python <- other_than_managed(plan, output, call)
    unlink(venv_folder(folder), recursive = TRUE)
  }
  # The path of a Python, as a command such as python3 may stand for several versions.
  make_venv(
    uv, c("venv", "--no-managed-python", "--no-python-downloads", "--python", plan$base_python),
    plan$base_python, folder, call
  )
}

venv_folder <- function(folder) file.path(folder, "venv")

make_venv <- function(tool, arguments, python, folder, call) {
  output <- run_tool(tool, c(arguments, venv_folder(folder)))
  if (failed(output)) {
    abort_tool(paste("No environment could be made with", python), output, call)
  }
}

# Another Python than the one that uv installs: many networks block the place where uv gets its own.
other_than_managed <- function(plan, output, call) {
  versions <- plan$bundle$python %||% lock_pythons
  python <- find_base_python(with_venv = FALSE, versions = versions)
  if (is.null(python)) {
    abort_tool(
      paste0("uv could not install a Python, and there is no Python ",
             paste(range(versions), collapse = " to "), " on this machine"),
      output, call,
      more = c(
        paste("Install one of these and call `gym_server_install()` again; or set",
              "UV_PYTHON_INSTALL_MIRROR to a place from which uv can get its Pythons.")
      )
    )
  }
  cli::cli_inform(c(
    i = "uv could not install a Python of its own; {.path {python}} serves as well.",
    " " = "The reason is in {.path {install_log()}}."
  ))
  python
}

# uv's Pythons lie beside the environments, so that they are removed together, and on Windows not in
# a roaming profile.
managed_python_place <- function() {
  place <- Sys.getenv("UV_PYTHON_INSTALL_DIR")
  c(UV_PYTHON_INSTALL_DIR = if (nzchar(place)) place else managed_python_folder(), not_registered)
}

# uv puts no command on the PATH and makes no entry in the registry.
not_registered <- c(UV_PYTHON_INSTALL_BIN = "0", UV_PYTHON_INSTALL_REGISTRY = "0")

bundled_python_place <- function(bundle) {
  if (!is.null(bundle)) {
    c(UV_PYTHON_CACHE_DIR = file.path(bundle$dir, "python"))
  }
}

install_packages <- function(folder, uv, plan, call) {
  python <- environment_python(folder)
  source <- if (!is.null(plan$bundle)) {
    c("--no-index", "--find-links", file.path(plan$bundle$dir, "wheels"))
  }
  requirements <- as.vector(rbind("-r", lock_files(plan$extras)))
  output <- if (is.null(uv)) {
    run_tool(python, c(
      "-I", "-m", "pip", "install", "--require-hashes", "--only-binary", ":all:", "--no-deps",
      source, requirements
    ))
  } else {
    run_tool(uv, c(
      "pip", "install", "--python", python, "--require-hashes", "--no-build", "--no-deps",
      source, requirements
    ))
  }
  if (failed(output)) {
    abort_tool("The server's packages could not be installed", output, call)
  }
}

# Imports the server as it will be run, and looks for the extras' modules. The exit status alone
# does not suffice: a Python that is an empty file has the exit status 0, too.
try_environment <- function(python, extras) {
  modules <- c(
    box2d = "Box2D", mujoco = "mujoco", atari = "ale_py", atari = "cv2", video = "moviepy"
  )
  modules <- modules[names(modules) %in% extras]
  script <- c(
    "import importlib.util",
    "import gym_server.cli.main, gymnasium.envs.classic_control, pygame",
    sprintf("if not importlib.util.find_spec('%s'): raise SystemExit('%s is missing')",
            modules, modules),
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
