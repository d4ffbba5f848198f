#' Install the server's Python environment
#'
#' Make a Python environment for the server that comes with this package. You do not need to know
#' Python. The environment has exact package versions that were tested together, and each file is
#' checked by its hash. Nothing is compiled, and no other Python on the machine is changed.
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
#'   `"atari"`, `"video"` and `"jax"` (600 MB). The default is none. Classic control and toy text
#'   work without extras.
#' @param ... Must be empty.
#' @param offline A folder filled by [gym_server_bundle()] on another machine, a string, to install
#'   without the network. `NULL`, the default, installs from the network.
#' @param ask Ask first, showing the packages, the megabytes and the folder? By default `TRUE` in an
#'   interactive session. In a script the call itself is consent.
#' @return The path of the environment's Python, a string, invisibly. `NULL`, invisibly, if the
#'   answer was no.
#' @section Errors: `gym_error_install`, with advice, if the installation failed; an earlier
#'   installation is kept. `gym_error_argument`.
#' @seealso [gym_server_bundle()], [gym_client()]
#' @export
#' @examples
#' # Asks in an interactive session:
#' if (interactive()) gym_server_install()
gym_server_install <- function(extras = character(), ..., offline = NULL,
                               ask = rlang::is_interactive()) {
  check_extras(extras)
  check_dots_empty(...)
  check_string(offline, allow_null = TRUE)
  check_flag(ask)
  call <- rlang::current_env()
  check_named_python(call)
  wanted <- server_extras[server_extras %in% c(extras, earlier_extras())]
  # A bundle that does not fit is an error even if it is not needed.
  bundle <- if (!is.null(offline)) read_bundle(offline, wanted, call)
  there <- installed_server()
  if (has_all(there, wanted)) {
    needed <- if (!is.null(bundle)) "; the bundle was not needed"
    cli::cli_inform(c(v = "The server is installed already, in {.path {there$folder}}{needed}."))
    remove_old_folders()
    return(invisible(there$python))
  }
  plan <- install_plan(wanted, bundle, call)
  if (ask && !confirm_install(plan)) {
    return(invisible())
  }
  python <- withCallingHandlers(install_environment(plan, call), interrupt = function(cnd) {
    cli::cli_inform(c("!" = "Interrupted: {.code gym_server_install()} continues from here."))
  })
  inform_of_precedence(python)
  invisible(python)
}

# Whether an environment has the extras and its server can be imported.
has_all <- function(there, extras) {
  !is.null(there) && all(extras %in% there$extras) && !failed(try_environment(there$python, extras))
}

# The Python in GYM_PYTHON is used before an installed one: if it cannot run the server, an
# installation would not help.
check_named_python <- function(call) {
  named <- Sys.getenv("GYM_PYTHON")
  if (!nzchar(named)) {
    return(invisible())
  }
  about <- probe_python(path.expand(named))
  if (isTRUE(about$fits)) {
    return(invisible())
  }
  what <- if (is.null(about)) "which does not run" else paste0("which is Python ", about$version)
  abort_install(
    c(
      paste0("The variable GYM_PYTHON names ", named, ", ", what, "."),
      i = "The server needs 64-bit Python 3.10 to 3.13, and that Python is used first.",
      i = paste("`Sys.unsetenv(\"GYM_PYTHON\")`, and the same in ~/.Renviron; then",
                "`gym_server_install()` again.")
    ),
    call = call
  )
}

# Asks a Python for its version and checks it against the lock files. Returns NULL for a Python that
# does not run.
probe_python <- function(python) {
  output <- run_quietly(
    python, c("-I", "-c", probe), timeout = 60, env = tool_environment()
  )$stdout
  words <- strsplit(trimws(output), " ", fixed = TRUE)[[1L]]
  if (length(words) != 4L || words[[1L]] != "python") {
    return(NULL)
  }
  version <- words[[2L]]
  list(
    version = version,
    fits = version %in% c("3.10", "3.11", "3.12", "3.13") && words[[3L]] == "CPython" &&
      words[[4L]] == "64"
  )
}

# The code for probe_python(). Run it with -I, which every Python that the server supports has.
probe <- paste(
  "import platform, sys",
  "print('python', '%d.%d' % sys.version_info[:2], platform.python_implementation(),",
  "      64 if sys.maxsize > 2**32 else 32)",
  sep = "\n"
)

# Warns if this session will not use the new installation.
inform_of_precedence <- function(python) {
  named <- Sys.getenv("GYM_PYTHON")
  if (nzchar(named) && !identical(path.expand(named), python)) {
    cli::cli_inform(c(
      "!" = "The variable GYM_PYTHON is set, and its Python is used first.",
      " " = "{.code Sys.unsetenv(\"GYM_PYTHON\")} makes this session use the installed one."
    ))
  }
}

#' Install the server's Python environment if the user agrees
#'
#' The user agrees by the environment variable GYM_INSTALL, or when asked now. A session that
#' declined is not asked again.
#' @return The path of the environment's Python, or `NULL` without consent.
#' @noRd
prompt_for_python <- function() {
  if (lower_case(Sys.getenv("GYM_INSTALL")) %in% c("1", "true", "yes")) {
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
