# Which Python runs the server: where to look for it, and the error if there is none.

#' Say that no Python can run the server
#' @param refusals Why each tried Python cannot, strings named by its path.
#' @noRd
abort_no_python <- function(python, refusals, call = rlang::caller_env()) {
  named <- named_python(python)
  own <- refusals[names(refusals) %in% installed_server()$python]
  message <- if (!is.null(named)) {
    # For users who chose a Python.
    by <- if (is.null(python)) "GYM_PYTHON" else "`python`"
    unset <- if (is.null(python)) " (`Sys.unsetenv(\"GYM_PYTHON\")`)"
    c(
      paste0("The Python that ", by, " names cannot run the server."),
      x = paste0(named, ": ", refusals),
      i = if (any(grepl("No module named", refusals, fixed = TRUE))) {
        paste("What it lacks, in a terminal:", pip_install_server(quote_for_terminal(named)))
      },
      i = paste0("Without ", by, unset, " the session uses the one that ",
                 "`gym::gym_server_install()` installs.")
    )
  } else if (length(own)) {
    # For users who do not know Python; gym_sitrep() has the details.
    c("The Python that was installed for the server cannot run it.",
      x = paste0(names(own), ": ", own), i = "`gym::gym_server_install()` installs it again.")
  } else {
    c("The server needs a Python of its own, which is not installed yet.",
      i = "`gym::gym_server_install()` installs it.",
      i = if (!rlang::is_interactive()) {
        "With the environment variable GYM_INSTALL=1 a script does so by itself."
      })
  }
  gym_abort(message, class = "gym_error_server_start", refusals = refusals, call = call)
}

# The command by which a Python installs the server.
pip_install_server <- function(python) {
  folder <- normalizePath(system.file("server", package = "gym"))
  paste(python, "-m pip install", quote_for_terminal(folder))
}

#' Find out whether a Python can run the server
#'
#' It imports the whole server and prints its version.
#' @param timeout The time for that, in seconds.
#' @param before Lines of Python to run first, a string.
#' @return Why it cannot, a string, or `NULL`.
#' @noRd
python_problem <- function(python, timeout = 60, before = "") {
  run <- run_quietly(
    python, c("-c", paste0(before, run_server), "--version"), timeout, server_environment()
  )
  if (is.na(run$status)) {
    return(paste0(not_started_reason(python), ", or does not answer in ", timeout, " s"))
  }
  # An empty executable file also ends with status 0.
  if (run$status != 0L || !nzchar(run$stdout)) refusal_reason(strsplit(run$stderr, "\n")[[1L]])
}

quote_for_terminal <- function(path) shQuote(path, if (is_windows()) "cmd" else "sh")

# The Python that the user chose, or NULL.
named_python <- function(python) {
  named <- python %||% Sys.getenv("GYM_PYTHON")
  if (nzchar(named)) path.expand(named)
}

# Where Python may be, in the order of the trials.
python_candidates <- function(python = NULL) {
  named <- named_python(python)
  if (!is.null(named)) {
    return(named)
  }
  active <- Sys.getenv(c("VIRTUAL_ENV", "CONDA_PREFIX"), names = FALSE)
  folder <- if (is_windows()) c("Scripts", ".") else "bin"
  places <- file.path(rep(active[nzchar(active)], each = length(folder)), folder)
  path <- strsplit(Sys.getenv("PATH"), .Platform$path.sep, fixed = TRUE)[[1L]]
  # The folder WindowsApps has a program named python that opens the Store.
  path <- grep("WindowsApps", path[nzchar(path)], value = TRUE, invert = TRUE)
  if (lacks_developer_tools()) path <- setdiff(path, "/usr/bin")
  found <- c(pythons_in(places), installed_server()$python, pythons_in(path))
  # The Python of an environment may be a link to one elsewhere that lacks its packages.
  found[!duplicated(paste(normalizePath(dirname(found)), normalizePath(found)))]
}

pythons_in <- function(places) {
  commands <- paste0(c("python3", "python"), if (is_windows()) ".exe")
  found <- file.path(rep(places, each = length(commands)), rep(commands, length(places)))
  found[file.access(found, 1L) == 0L]
}

# Without the developer tools /usr/bin/python3 of macOS only opens a dialog.
lacks_developer_tools <- function() {
  Sys.info()[["sysname"]] == "Darwin" &&
    !identical(run_quietly("/usr/bin/xcode-select", "-p", timeout = 5)$status, 0L)
}
