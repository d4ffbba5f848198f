#' Install what the server needs
#'
#' Makes a Python environment for the server that comes with this package, so that nobody needs
#' to know Python. It holds exact versions that were tried together, each file checked by its
#' hash; nothing is compiled, and no other Python on the machine is changed.
#'
#' [uv](https://docs.astral.sh/uv/) does the work where it is found: the program that the
#' environment variable `GYM_UV` or `RETICULATE_UV` names, one on the `PATH`, in `~/.local/bin`
#' or the one that reticulate brought. It also brings a Python of its own; where the network
#' does not let that through, a Python 3.10 to 3.13 on the machine is taken. Without uv such a
#' Python's `venv` and pip do it, and without both uv is downloaded first, a release that this
#' package names, checked by its hash.
#'
#' The environment lies in `tools::R_user_dir("gym", "cache")`. [gym_client()] finds it there.
#' Extras that were installed before are kept. A call that finds everything there checks it,
#' says so and changes nothing; what was damaged is made anew.
#'
#' @param extras What to install beside the server, a character vector with any of
#'   `"toy-text"`, `"box2d"`, `"mujoco"`, `"atari"` and `"video"`; the default is none. The
#'   environments of classic control and toy text need none.
#' @param ... Must be empty.
#' @param offline A folder that [gym_server_bundle()] filled on another machine, a string: the
#'   network is not used. `NULL`, the default, installs from the network.
#' @param ask Whether to ask first, telling what, how many megabytes and where; by default
#'   `TRUE` in an interactive session. In a script the call is consent.
#' @return The path of the environment's Python, a string, invisibly; `NULL`, invisibly, when
#'   the answer was no.
#' @section Errors: `gym_error_install` when it did not succeed, with what to do; whatever was
#'   installed before is still there. `gym_error_argument`.
#' @seealso [gym_server_bundle()], [gym_client()]
#' @export
#' @examples
#' # Asks in an interactive session:
#' if (interactive()) gym_server_install()
gym_server_install <- function(extras = character(), ..., offline = NULL,
                               ask = rlang::is_interactive()) {
  check_extras(extras)
  check_no_dots(...)
  check_string(offline, allow_null = TRUE)
  check_flag(ask)
  call <- rlang::current_env()
  check_named_python(call)
  wanted <- wanted_extras(extras)
  there <- installed_server()
  if (has_all(there, wanted)) {
    cli::cli_inform(c(v = "The server is installed in {.path {there$folder}}."))
    return(invisible(there$python))
  }
  plan <- install_plan(wanted, call)
  if (ask && !confirm_install(plan)) {
    return(invisible())
  }
  python <- in_turn({
    there <- installed_server()
    # Another session may have done it meanwhile.
    if (has_all(there, wanted)) there$python else install_environment(plan, call)
  })
  tell_what_comes_first(python)
  invisible(python)
}

check_no_dots <- function(..., call = rlang::caller_env()) {
  if (...length()) {
    gym_abort(
      "`...` must be empty: `offline` and `ask` need their names.",
      class = "gym_error_argument",
      call = call
    )
  }
}

wanted_extras <- function(extras) {
  server_extras[server_extras %in% c(extras, earlier_extras())]
}

# Whether an environment has the extras, and its server can really be imported.
has_all <- function(there, extras) {
  !is.null(there) && all(extras %in% there$extras) && !failed(try_environment(there$python, extras))
}

confirm_install <- function(plan) {
  what <- c(
    "The server that plays the environments needs Python packages on this machine.",
    paste0("What:  ", describe_plan(plan)),
    sprintf("Size:  about %.0f MB to download, %.0f MB on the disk",
            plan$megabytes[["download"]], plan$megabytes[["disk"]]),
    paste0("Where: ", install_root())
  )
  ask_yes_no(paste(c(what, "Install them?"), collapse = "\n"), default = TRUE)
}

describe_plan <- function(plan) {
  extras <- if (length(plan$extras)) paste0(" (with ", toString(plan$extras), ")")
  paste0(
    "Gymnasium", extras, ", ",
    switch(plan$how,
      uv = paste0("by uv (", plan$tool, "), which brings Python ", managed_python_version),
      python = paste0("by ", plan$tool),
      download = paste0("by uv ", uv_release$version, ", which is downloaded first and brings Python ",
                        managed_python_version)
    )
  )
}

install_environment <- function(plan, call) {
  started <- Sys.time()
  write_log(c("", paste("##", format(started), "gym", utils::packageVersion("gym"), plan$how)))
  folder <- make_folder()
  whole <- FALSE
  on.exit(if (!whole) remove_folder(folder))
  cli::cli_inform(c(
    i = "Installing {describe_plan(plan)}: about {round(plan$megabytes[['download']])} MB."
  ))
  uv <- if (plan$how == "uv") plan$tool else if (plan$how == "download") bring_uv(call)
  make_environment(folder, uv, plan$tool, call)
  install_packages(folder, uv, plan$extras, call)
  python <- environment_python(folder)
  trial <- try_environment(python, plan$extras)
  if (failed(trial)) {
    abort_tool("The packages are installed, but the server cannot be run with them", trial, call)
  }
  write_marker(folder, plan$extras)
  whole <- TRUE
  remove_other_folders(keep = folder)
  seconds <- as.numeric(difftime(Sys.time(), started, units = "secs"))
  cli::cli_inform(c(v = "Installed in {round(seconds)} s, in {.path {folder}}."))
  python
}

make_environment <- function(folder, uv, python, call) {
  venv <- file.path(folder, "venv")
  if (is.null(uv)) {
    output <- run_tool(python, c("-I", "-m", "venv", venv))
    if (failed(output)) {
      abort_tool(paste("No environment could be made with", python), output, call)
    }
    return(invisible())
  }
  output <- run_tool(
    uv, c("venv", "--managed-python", "--python", managed_python_version, venv),
    env = managed_python_place()
  )
  if (!failed(output)) {
    return(invisible())
  }
  python <- find_base_python(with_venv = FALSE)
  if (is.null(python)) {
    abort_no_managed_python(output, call)
  }
  cli::cli_inform(c(
    "!" = "uv could not bring a Python, so {.path {python}} is taken (see {.path {install_log()}})."
  ))
  unlink(venv, recursive = TRUE)
  output <- run_tool(uv, c("venv", "--no-managed-python", "--python", python, venv))
  if (failed(output)) {
    abort_tool(paste("No environment could be made with", python), output, call)
  }
}

# Beside the environments, so that it goes when they go, and on Windows does not roam.
managed_python_place <- function() {
  if (nzchar(Sys.getenv("UV_PYTHON_INSTALL_DIR"))) {
    return(character())
  }
  c(UV_PYTHON_INSTALL_DIR = managed_python_folder())
}

install_packages <- function(folder, uv, extras, call) {
  python <- environment_python(folder)
  requirements <- as.vector(rbind("-r", lock_files(extras)))
  output <- if (is.null(uv)) {
    run_tool(python, c(
      "-I", "-m", "pip", "install", "--require-hashes", "--only-binary", ":all:", "--no-deps",
      "--no-compile", requirements
    ))
  } else {
    run_tool(uv, c(
      "pip", "install", "--python", python, "--require-hashes", "--no-build", "--no-deps",
      requirements
    ))
  }
  if (failed(output)) {
    abort_tool("The server's packages could not be installed", output, call)
  }
}

# Import the server as it will be run, and look for what the extras bring.
try_environment <- function(python, extras) {
  modules <- c(
    box2d = "Box2D", mujoco = "mujoco", atari = "ale_py", atari = "cv2", video = "moviepy"
  )
  modules <- modules[names(modules) %in% extras]
  script <- paste0(
    "import importlib.util, gym_server.cli\n",
    paste0("import gymnasium.envs.classic_control, pygame\n",
           if (length(modules)) paste0("assert importlib.util.find_spec('", modules, "'), '",
                                       modules, " is missing'\n", collapse = ""))
  )
  run_tool(python, c("-c", script), env = c(
    PYTHONPATH = system.file("server", package = "gym"), PYTHONDONTWRITEBYTECODE = "1"
  ))
}

abort_no_managed_python <- function(output, call) {
  abort_tool("uv could not bring a Python, and this machine has no Python 3.10 to 3.13", output, call)
}

check_named_python <- function(call) NULL
tell_what_comes_first <- function(python) NULL
