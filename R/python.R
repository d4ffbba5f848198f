# Which Python runs the server: where it is looked for, and what to say when there is none.

abort_no_python <- function(python, candidates, refusals, call = rlang::caller_env()) {
  looked <- if (length(candidates)) paste0(candidates, ": ", refusals)
  gym_abort(
    c(
      "No Python was found that can run the server.",
      stats::setNames(looked, rep("x", length(looked))),
      i = if (is.null(python)) {
        paste("Python is looked for in GYM_PYTHON or, where that is not set, in an active",
              "virtual environment and on the PATH.")
      },
      i = "The server needs Python 3.10 or newer and a few packages. In a terminal:",
      stats::setNames(installing_commands(), c(" ", " ")),
      i = "and then, in R:",
      " " = paste0("Sys.setenv(GYM_PYTHON = \"", installed_python(), "\")"),
      i = "To make that last, put it into ~/.Renviron as GYM_PYTHON=..."
    ),
    class = "gym_error_server_start",
    candidates = candidates,
    call = call
  )
}

# An environment of its own: a system's Python often refuses packages.
installing_commands <- function() {
  server <- system.file("server", package = "gym")
  if (is_windows()) {
    c("py -m venv \"%USERPROFILE%\\gym-python\"",
      paste0("\"%USERPROFILE%\\gym-python\\Scripts\\python\" -m pip install ",
             shQuote(normalizePath(server), type = "cmd")))
  } else {
    c("python3 -m venv ~/gym-python",
      paste("~/gym-python/bin/python -m pip install", shQuote(server)))
  }
}

installed_python <- function() {
  if (is_windows()) {
    file.path(chartr("\\", "/", Sys.getenv("USERPROFILE")), "gym-python/Scripts/python.exe")
  } else {
    "~/gym-python/bin/python"
  }
}

# Where Python may be, in the order in which it is tried.
python_candidates <- function(python = NULL) {
  named <- python %||% Sys.getenv("GYM_PYTHON")
  if (nzchar(named)) {
    return(path.expand(named))
  }
  active <- Sys.getenv(c("VIRTUAL_ENV", "CONDA_PREFIX"), names = FALSE)
  folder <- if (is_windows()) c("Scripts", ".") else "bin"
  places <- file.path(rep(active[nzchar(active)], each = length(folder)), folder)
  path <- strsplit(Sys.getenv("PATH"), .Platform$path.sep, fixed = TRUE)[[1L]]
  # Windows' WindowsApps holds a stand-in that opens the Store.
  path <- grep("WindowsApps", path[nzchar(path)], value = TRUE, invert = TRUE)
  found <- c(pythons_in(places), installed_server()$python, pythons_in(path))
  # An environment's Python may be a link to one that lies elsewhere and lacks its packages.
  found[!duplicated(paste(normalizePath(dirname(found)), normalizePath(found)))]
}

pythons_in <- function(places) {
  commands <- paste0(c("python3", "python"), if (is_windows()) ".exe")
  found <- file.path(rep(places, each = length(commands)), rep(commands, length(places)))
  found[file.access(found, 1L) == 0L]
}

is_windows <- function() .Platform$OS.type == "windows"
