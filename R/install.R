#' Install what the server needs
#'
#' Makes a Python environment for the server that comes with this package, so that nobody needs
#' to know Python. It holds exact versions that were tried together, each file checked by its
#' hash; nothing is compiled, and no other Python on the machine is changed.
#'
#' [uv](https://docs.astral.sh/uv/) does the work where it is found: the program that the
#' environment variable `GYM_UV` or `RETICULATE_UV` names, one on the `PATH`, in `~/.local/bin`
#' or the one that reticulate installed. It also installs a Python of its own; where the network
#' does not let that through, a Python 3.10 to 3.13 on the machine is taken. Without uv such a
#' Python's `venv` and pip do it, and without both uv is downloaded first, a release that this
#' package names, checked by its hash.
#'
#' The environment lies in `tools::R_user_dir("gym", "cache")`. [gym_client()] finds it there.
#' Extras that were installed before are kept. A call that finds everything there checks it,
#' says so and changes nothing; what was damaged is made anew.
#'
#' Environment variables change where things come from and go, set by [Sys.setenv()] or in
#' `~/.Renviron`: `R_USER_CACHE_DIR` is the place of the cache folder; `HTTPS_PROXY` the
#' network's proxy; `SSL_CERT_FILE` the file of its certificates; `UV_PYTHON_INSTALL_MIRROR`
#' where uv gets its Pythons, and `UV_DOWNLOAD_URL` where uv itself is downloaded from. uv and
#' pip go by their own settings, such as those of an institution's mirror.
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
  plan <- if (!is.null(offline)) bundle_plan(offline, wanted, call)
  there <- installed_server()
  if (has_all(there, wanted)) {
    needed <- if (!is.null(plan)) "; the bundle was not needed"
    cli::cli_inform(c(v = "The server is installed already, in {.path {there$folder}}{needed}."))
    if (length(install_folders()) > 1L) {
      with_install_lock(remove_other_folders(keep = there$folder))
    }
    return(invisible(there$python))
  }
  plan <- plan %||% install_plan(wanted, call)
  if (ask && !confirm_install(plan)) {
    return(invisible())
  }
  python <- with_interrupt_message(with_install_lock({
    there <- installed_server()
    if (has_all(there, wanted)) {
      cli::cli_inform(c(v = "Another session has installed it, in {.path {there$folder}}."))
      there$python
    } else {
      install_environment(plan, call)
    }
  }))
  inform_of_precedence(python)
  invisible(python)
}

with_interrupt_message <- function(code) {
  withCallingHandlers(code, interrupt = function(cnd) {
    cli::cli_inform(c("!" = "Interrupted: what was begun is removed again."))
  })
}

# Whether an environment has the extras, and its server can really be imported.
has_all <- function(there, extras) {
  !is.null(there) && all(extras %in% there$extras) && !failed(try_environment(there$python, extras))
}

confirm_install <- function(plan, call = rlang::caller_env()) {
  what <- c(
    "The server that plays the environments needs Python packages on this machine.",
    paste0("What:  ", describe_plan(plan)),
    sprintf("Size:  %s, %.0f MB on the disk", describe_download(plan), plan$megabytes[["disk"]]),
    paste0("Where: ", install_root())
  )
  # No by default: an empty line of a pasted script must not start a download.
  ask_yes_no(paste(c(what, "Install them?"), collapse = "\n"), default = FALSE, call = call)
}

describe_plan <- function(plan) {
  uv <- if (plan$how == "download") {
    paste("downloading uv", uv_release$version)
  } else if (is.null(plan$bundle$uv)) {
    paste("with", plan$tool)
  } else {
    "with the bundle's uv"
  }
  python <- if (!is.null(plan$base_python)) {
    paste(" for", plan$base_python)
  } else if (plan$how != "python") {
    paste(" and installing Python", managed_python_version)
  }
  paste0(
    describe_packages(plan$extras), ", ",
    if (plan$how == "python") paste("with pip, for", plan$tool) else paste0(uv, python)
  )
}

describe_packages <- function(extras) {
  paste0("the games of Gymnasium", if (length(extras)) paste0(" (with ", toString(extras), ")"))
}

describe_download <- function(plan) {
  if (!is.null(plan$bundle)) {
    return(paste0("from ", plan$bundle$dir, ", without a network"))
  }
  sprintf("about %.0f MB to download", plan$megabytes[["download"]])
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

# Says what keeps this session from using what was installed.
inform_of_precedence <- function(python) {
  named <- Sys.getenv("GYM_PYTHON")
  if (nzchar(named) && !identical(path.expand(named), python)) {
    cli::cli_inform(c(
      "!" = "The variable GYM_PYTHON is set, and the Python that it names comes first.",
      " " = "{.code Sys.unsetenv(\"GYM_PYTHON\")} has this session use what was installed."
    ))
  }
  running <- Filter(function(server) {
    is_installed_python(server$python) && server$python != python && server$process$is_alive()
  }, the_session$servers)
  if (length(running)) {
    cli::cli_inform(c(
      "!" = "This session's server still runs from what was installed before.",
      " " = "{.code gym_server_stop()} ends it; the next {.code gym_make()} starts one anew."
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
