# The folder of the server's Python environment. Each version of the lock files has its own, so that
# servers of sessions with another package version keep running.
#
#   <cache>/gym/<lock's hash>/venv        the environment
#                           /installed   its manifest, written when it is complete: the extras;
#                                        the file's time is the last start of a server

install_root <- function() cache_of("gym")

cache_of <- function(package) absolute_path(tools::R_user_dir(package, "cache"))

environment_folder <- function() file.path(install_root(), lock_hash())

environment_python <- function(folder) {
  file.path(folder, "venv", if (is_windows()) "Scripts/python.exe" else "bin/python")
}

# The folders of all versions of the package, last used first.
install_folders <- function() {
  folders <- list.files(install_root(), "^[0-9a-f]{12}", full.names = TRUE)
  folders[order(last_used(folders), decreasing = TRUE)]
}

last_used <- function(folders) {
  pmax(file.mtime(folders), file.mtime(file.path(folders, "installed")), na.rm = TRUE)
}

make_folder <- function(folder, call) {
  dir.create(folder, recursive = TRUE, showWarnings = FALSE)
  if (!dir.exists(folder)) {
    abort_install(
      c(
        paste0("The folder ", folder, " cannot be made."),
        i = "Check that you can write there and that the disk is not full.",
        i = "The environment variable R_USER_CACHE_DIR sets another place for it."
      ),
      call = call
    )
  }
}

#' Find the installed environment
#' @return `NULL`, or a list: `python`, the path of its Python; `folder`; `extras`, those that are
#'   installed.
#' @noRd
installed_server <- function() {
  folder <- environment_folder()
  extras <- read_extras(folder)
  python <- environment_python(folder)
  if (!is.null(extras) && file.exists(python)) {
    list(python = python, folder = folder, extras = extras)
  }
}

# The extras of the last installation, also by an earlier version of the package.
earlier_extras <- function() {
  for (folder in c(environment_folder(), install_folders())) {
    extras <- read_extras(folder)
    if (!is.null(extras)) {
      return(intersect(extras, server_extras))
    }
  }
  character()
}

# NULL for an incomplete folder.
read_extras <- function(folder) {
  path <- file.path(folder, "installed")
  fields <- if (file.exists(path)) tryCatch(read.dcf(path)[1L, ], error = function(cnd) NULL)
  if (all(c("Extras", "End") %in% names(fields))) {
    strsplit(fields[["Extras"]], " ", fixed = TRUE)[[1L]]
  }
}

write_extras <- function(folder, extras, call) {
  path <- file.path(folder, "installed")
  try(suppressWarnings(
    writeLines(c(paste("Extras:", paste(extras, collapse = " ")), "End: yes"), path)
  ), silent = TRUE)
  if (!identical(read_extras(folder), extras)) {
    abort_install(
      c(paste0("The file ", path, " cannot be written."),
        i = "Is the disk full? `gym_server_install()` continues from here."),
      call = call
    )
  }
}

is_installed_python <- function(python) {
  !is.null(python) && startsWith(python, paste0(install_root(), "/"))
}

# Called before a server starts, so that its environment is not removed as unused.
use_python <- function(python) {
  if (is_installed_python(python)) {
    manifest <- file.path(dirname(dirname(dirname(python))), "installed")
    # Changing the time fails in another user's environment.
    suppressWarnings(Sys.setFileTime(manifest, Sys.time()))
  }
}

# Servers of other sessions, also on other machines with the same home, may run from another
# version's environment. A killed session may have left a copy or a download.
remove_old_folders <- function() {
  folders <- list.files(install_root(), "^([0-9a-f]{12}|bundle-|download-)", full.names = TRUE)
  others <- setdiff(folders, environment_folder())
  old <- difftime(Sys.time(), last_used(others), units = "days") > 30
  unlink(others[old], recursive = TRUE, force = TRUE)
}
