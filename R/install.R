#' Install what the server needs
#'
#' Makes a Python environment for the server that comes with this package, so that nobody needs
#' to know Python. It holds exact versions that were tried together, each file checked by its
#' hash; nothing is compiled, and no other Python on the machine is changed.
#'
#' [uv](https://docs.astral.sh/uv/) does the work where it is found: the program that the
#' environment variable `GYM_UV` or `RETICULATE_UV` names, one on the `PATH`, in `~/.local/bin`
#' or the one that reticulate installed. Where there is none it is downloaded first, a release that
#' this package names, checked by its hash. uv also installs a Python of its own; where the network
#' does not let that through, a Python 3.10 to 3.13 on the machine is taken. uv's variable
#' `UV_PYTHON` names another one, by its path or version. Where uv cannot be had, install the
#' packages into a Python by any other means, and have `GYM_PYTHON` name it: see
#' `vignette("server")`.
#'
#' The environment lies in `tools::R_user_dir("gym", "cache")`. [gym_client()] finds it there.
#' Extras that were installed before are kept, and servers that run from there find new ones. A
#' call that finds everything there checks it, says so and changes nothing; what was damaged is
#' made anew.
#'
#' Environment variables change where things come from and go, set by [Sys.setenv()] or in
#' `~/.Renviron`: `R_USER_CACHE_DIR` is the place of the cache folder; `HTTPS_PROXY` the
#' network's proxy; `SSL_CERT_FILE` the file of its certificates; `UV_PYTHON_INSTALL_MIRROR`
#' where uv gets its Pythons, and `UV_DOWNLOAD_URL` where uv itself is downloaded from. uv goes by
#' its own settings, such as those of an institution's mirror.
#'
#' @param extras What to install beside the server, a character vector with any of
#'   `"toy-text"`, `"box2d"`, `"mujoco"`, `"atari"` and `"video"`; the default is none. The
#'   environments of classic control and toy text need none.
#' @param ... Must be empty.
#' @param offline A folder that [gym_server_bundle()] filled on another machine, a string: the
#'   network is not used. `NULL`, the default, installs from the network.
#' @param ask Whether to ask first, saying what, how many megabytes and where; by default
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
  check_dots_empty(...)
  check_string(offline, allow_null = TRUE)
  check_flag(ask)
  call <- rlang::current_env()
  check_named_python(call)
  wanted <- server_extras[server_extras %in% c(extras, earlier_extras())]
  # A bundle that does not fit is an error also when it is not needed.
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
  python <- with_interrupt_message(install_environment(plan, call))
  inform_of_precedence(python)
  invisible(python)
}

with_interrupt_message <- function(code) {
  withCallingHandlers(code, interrupt = function(cnd) {
    cli::cli_inform(c("!" = "Interrupted: {.code gym_server_install()} goes on from there."))
  })
}

# Whether an environment has the extras, and its server can really be imported.
has_all <- function(there, extras) {
  !is.null(there) && all(extras %in% there$extras) && !failed(try_environment(there$python, extras))
}

# The Python that GYM_PYTHON names is used before an installed one: if it cannot run the server, an
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
      i = "The server needs 64-bit Python 3.10 to 3.13, and the Python named there comes first.",
      i = paste("`Sys.unsetenv(\"GYM_PYTHON\")`, and the same in ~/.Renviron; then",
                "`gym_server_install()` again.")
    ),
    call = call
  )
}

# Asks a Python for its version, and whether the lock files are for it. Returns NULL for a Python
# that does not run.
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

# What probe_python() runs. It is run with -I, which every Python that the server can use knows.
probe <- paste(
  "import platform, sys",
  "print('python', '%d.%d' % sys.version_info[:2], platform.python_implementation(),",
  "      64 if sys.maxsize > 2**32 else 32)",
  sep = "\n"
)

# Says what keeps this session from using what was installed.
inform_of_precedence <- function(python) {
  named <- Sys.getenv("GYM_PYTHON")
  if (nzchar(named) && !identical(path.expand(named), python)) {
    cli::cli_inform(c(
      "!" = "The variable GYM_PYTHON is set, and the Python that it names comes first.",
      " " = "{.code Sys.unsetenv(\"GYM_PYTHON\")} has this session use what was installed."
    ))
  }
}

#' Install the server's Python environment if somebody agrees
#'
#' Either beforehand, by the environment variable GYM_INSTALL, or now, when asked. A session that
#' declined is not asked again.
#' @return The path of the environment's Python, `NULL` when nobody agreed.
#' @noRd
prompt_for_python <- function() {
  if (lower_case(Sys.getenv("GYM_INSTALL")) %in% c("1", "true", "yes")) {
    return(keep_random_state(gym_server_install(ask = FALSE)))
  }
  if (!rlang::is_interactive() || isTRUE(the_session$install_declined)) {
    return(NULL)
  }
  # Processes get names that are drawn from R's generator.
  python <- keep_random_state(gym_server_install(ask = TRUE))
  the_session$install_declined <- is.null(python)
  python
}
