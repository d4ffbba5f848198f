# The folder of the server's Python environment, and the lock files that say what is in it. Each
# version of the lock files has its own folder, so that servers of sessions with another package
# version keep running.
#
#   <cache>/gym/<lock's hash>/venv        the environment
#                           /installed   its manifest, written when it is complete: the extras;
#                                        the file's time is the last start of a server
#           gym/python, gym/uv           what uv and the package downloaded

server_extras <- c("toy-text", "box2d", "mujoco", "atari", "video", "jax", "sb3")

check_extras <- function(extras, call = rlang::caller_env()) {
  if (!is.character(extras) || anyNA(extras) || !all(extras %in% server_extras)) {
    must <- paste("any of", paste0('"', server_extras, '"', collapse = ", "))
    abort_argument(extras, must, "extras", call)
  }
  for (extra in extras) {
    if (system_name() %in% unlist(strsplit(lock_entry(extra, "not for"), ", ", fixed = TRUE))) {
      abort_wrong(NULL, extra, call, class = "gym_error_install",
                  "The extra \"{extra}\" cannot be installed on this system ({system_name()}).",
                  i = "Its packages come ready to run for other systems only.",
                  i = "A server on another machine can have it: `create_GymClient()` takes that
                       server's address.")
    }
  }
}

# The name of this system in lock files.
system_name <- function() {
  info <- Sys.info()
  machine <- tolower(info[["machine"]])
  machine <- switch(machine, amd64 = , "x86-64" = "x86_64", machine)
  paste0(tolower(info[["sysname"]]), "-", machine)
}

# tools/lock writes the lock files: base.txt has the server's own packages, EXTRA.txt those of an
# extra.
lock_files <- function(extras) {
  system.file("server", "lock", paste0(c("base", extras), ".txt"), package = "gym")
}

# Identifies the lock files. It ignores line endings, because git and zip programs may change them.
lock_hash <- function() {
  lines <- unlist(lapply(lock_files(server_extras), readLines, warn = FALSE))
  substr(hex(openssl::sha256(charToRaw(paste(lines, collapse = "\n")))), 1L, 12L)
}

hex <- function(hash) paste(unclass(hash), collapse = "")

# The values of a "# key: value" at the top of the lock files.
lock_entry <- function(extras, key) {
  start <- paste0("# ", key, ": ")
  vapply(lock_files(extras), function(path) {
    lines <- readLines(path, n = 10L, warn = FALSE)
    substring(lines[startsWith(lines, start)][[1L]], nchar(start) + 1L)
  }, "", USE.NAMES = FALSE)
}

install_root <- function() absolute_path(tools::R_user_dir("gym", "cache"))

environment_folder <- function() file.path(install_root(), lock_hash())

environment_python <- function(folder) {
  file.path(folder, "venv", if (is_windows()) "Scripts/python.exe" else "bin/python")
}

#' Find the installed environment
#' @return `NULL`, or a list: `python`, the path of its Python; `folder`; `extras`, the installed
#'   extras.
#' @noRd
installed_server <- function() {
  folder <- environment_folder()
  extras <- read_extras(folder)
  python <- environment_python(folder)
  if (!is.null(extras) && file.exists(python)) {
    list(python = python, folder = folder, extras = extras)
  }
}

# NULL for an incomplete folder.
read_extras <- function(folder) {
  path <- file.path(folder, "installed")
  fields <- if (file.exists(path)) tryCatch(read.dcf(path)[1L, ], error = function(cnd) NULL)
  if (all(c("Extras", "End") %in% names(fields))) {
    strsplit(fields[["Extras"]], " ", fixed = TRUE)[[1L]]
  }
}

write_extras <- function(folder, extras) {
  writeLines(c(paste("Extras:", paste(extras, collapse = " ")), "End: yes"),
             file.path(folder, "installed"))
}

is_installed_python <- function(python) {
  !is.null(python) && startsWith(python, paste0(install_root(), "/"))
}

# Notes that an environment is in use, so that nobody removes it as an old one. Call it before a
# server starts.
use_python <- function(python) {
  if (is_installed_python(python)) {
    manifest <- file.path(dirname(dirname(dirname(python))), "installed")
    # Only the owner of an environment can change the time.
    suppressWarnings(Sys.setFileTime(manifest, Sys.time()))
  }
}

# Removes environments of other versions that nobody has used for 30 days. Others may be in use by
# servers of other sessions, also on other machines with the same home directory.
remove_old_folders <- function() {
  manifests <- Sys.glob(file.path(install_root(), "*", "installed"))
  old <- difftime(Sys.time(), file.mtime(manifests), units = "days") > 30
  unlink(setdiff(dirname(manifests[old]), environment_folder()), recursive = TRUE, force = TRUE)
}
