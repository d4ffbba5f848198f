# Making an environment, in a folder of its own: a Python, the packages of the lock, a trial, and
# the marker at the end.

install_environment <- function(plan, call) {
  started <- Sys.time()
  write_log(c("", paste("##", format(started), "gym", utils::packageVersion("gym"), plan$how)))
  folder <- make_folder(call)
  whole <- FALSE
  on.exit(leave_folder(folder, whole))
  plan <- take_bundled_uv(plan, call)
  cli::cli_inform(c(i = "Installing {describe_plan(plan)}: {describe_download(plan)}."))
  uv <- if (plan$how == "download") bring_uv(call) else if (plan$how == "uv") plan$tool
  make_environment(folder, uv, plan, call)
  install_packages(folder, uv, plan, call)
  python <- environment_python(folder)
  trial <- try_environment(python, plan$extras)
  if (failed(trial)) {
    abort_tool("The packages are installed, but the server cannot be run with them", trial, call)
  }
  write_marker(folder, plan$extras, call)
  whole <- TRUE
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
      uv, c("venv", "--managed-python", "--python", managed_python_version, venv_of(folder)),
      env = c(managed_python_place(), bundled_python_place(plan$bundle))
    )
    if (!failed(output)) {
      return(invisible())
    }
    plan$base_python <- other_than_managed(plan, output, call)
    unlink(venv_of(folder), recursive = TRUE)
  }
  # Its version, and not only that of a command that may stand for several.
  make_venv(
    uv, c("venv", "--no-managed-python", "--no-python-downloads", "--python", plan$base_python),
    plan$base_python, folder, call
  )
}

venv_of <- function(folder) file.path(folder, "venv")

make_venv <- function(tool, arguments, python, folder, call) {
  output <- run_tool(tool, c(arguments, venv_of(folder)))
  if (failed(output)) {
    abort_tool(paste("No environment could be made with", python), output, call)
  }
}

# Many networks refuse the place where uv gets its Pythons.
other_than_managed <- function(plan, output, call) {
  versions <- plan$bundle$python %||% lock_pythons
  python <- find_base_python(with_venv = FALSE, versions = versions)
  if (is.null(python)) {
    abort_tool(
      paste0("uv could not bring a Python, and there is no Python ",
             paste(range(versions), collapse = " to "), " on this machine"),
      output, call,
      more = c(
        paste("Install one of these and call `gym_server_install()` again; or set",
              "UV_PYTHON_INSTALL_MIRROR to a place from which uv can get its Pythons.")
      )
    )
  }
  cli::cli_inform(c(
    i = "uv could not bring a Python of its own; {.path {python}} serves as well.",
    " " = "Why is in {.path {install_log()}}."
  ))
  python
}

# Beside the environments, so that it goes when they go, and on Windows does not roam.
managed_python_place <- function() {
  place <- Sys.getenv("UV_PYTHON_INSTALL_DIR")
  c(UV_PYTHON_INSTALL_DIR = if (nzchar(place)) place else managed_python_folder(), only_there)
}

# No command on the PATH, no entry in the registry.
only_there <- c(UV_PYTHON_INSTALL_BIN = "0", UV_PYTHON_INSTALL_REGISTRY = "0")

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

# Import the server as it will be run, and look for what the extras bring. An exit status of 0
# alone says little: that of an empty file is 0, too.
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
