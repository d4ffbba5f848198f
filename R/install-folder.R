# Where the server's Python environments lie. Each installation makes a folder of its own, and no
# environment is changed after its installation: servers of other sessions keep running, and an
# interrupted installation leaves the environment that was there before.
#
#   <cache>/gym/<lock's hash>-<number>/venv         the environment
#                                     /installed    the manifest, written last: what is in it
#                                     /used-by/PID  a file for each R session that uses or makes it

install_root <- function() cache_of("gym")

cache_of <- function(package) absolute_path(tools::R_user_dir(package, "cache"))

install_folders <- function() {
  folders <- list.files(install_root(), "^[0-9a-f]{12}-[0-9]+$", full.names = TRUE)
  folders[order(folder_number(folders), decreasing = TRUE)]
}

# Marks folders that could be renamed, but not deleted yet.
renamed_suffix <- "-old"

renamed_folders <- function() {
  pattern <- paste0("^[0-9a-f]{12}-[0-9]+", renamed_suffix, "$")
  list.files(install_root(), pattern, full.names = TRUE)
}

folder_number <- function(folders) as.integer(sub(".*-", "", basename(folders)))

next_folder <- function() {
  number <- max(0L, folder_number(install_folders())) + 1L
  file.path(install_root(), paste0(lock_hash(), "-", number))
}

# Makes a folder that no other session uses, should it make one at the same time.
make_folder <- function(call) {
  repeat {
    folder <- next_folder()
    if (dir.create(folder, recursive = TRUE, showWarnings = FALSE)) {
      use_folder(folder)
      return(folder)
    }
    if (!dir.exists(folder)) {
      abort_folder(folder, call)
    }
  }
}

abort_folder <- function(folder, call) {
  abort_install(
    c(
      paste0("The folder ", folder, " cannot be made."),
      i = "It must be possible to write there, and the disk must have room.",
      i = "The environment variable R_USER_CACHE_DIR names another place for it."
    ),
    call = call
  )
}

# At the end of an installation: removes the file that names this session as the folder's user, and
# the folder itself if it is incomplete.
end_folder <- function(folder, complete) {
  unlink(file.path(folder, "used-by", as.character(Sys.getpid())))
  if (!complete) {
    remove_folder(folder)
  }
}

environment_python <- function(folder) {
  file.path(folder, "venv", if (is_windows()) "Scripts/python.exe" else "bin/python")
}

#' Find the installed environment
#'
#' An environment is complete when its manifest is there, which is written last, and when it has the
#' Python and the packages that the manifest names, as some may have been deleted.
#' @return `NULL`, or a list: `python`, the path of its Python; `folder`, its folder; `extras`,
#'   the extras that it holds.
#' @noRd
installed_server <- function() {
  hash <- lock_hash()
  for (folder in install_folders()) {
    manifest <- if (startsWith(basename(folder), hash)) read_manifest(folder)
    if (!is.null(manifest) && environment_is_complete(folder, manifest)) {
      return(list(
        python = environment_python(folder), folder = folder, extras = manifest$extras
      ))
    }
  }
  NULL
}

environment_is_complete <- function(folder, manifest) {
  file.exists(environment_python(folder)) &&
    all(manifest$packages %in% list.files(file.path(folder, manifest$site)))
}

# The extras that were installed last, also by an earlier version of the package.
earlier_extras <- function() {
  for (folder in install_folders()) {
    manifest <- read_manifest(folder)
    if (!is.null(manifest)) {
      return(intersect(manifest$extras, server_extras))
    }
  }
  character()
}

read_manifest <- function(folder) {
  path <- file.path(folder, "installed")
  if (!file.exists(path)) {
    return(NULL)
  }
  fields <- tryCatch(read.dcf(path)[1L, ], error = function(cnd) NULL)
  if (!all(c("Extras", "Site", "Packages", "End") %in% names(fields))) {
    return(NULL)
  }
  words <- function(field) strsplit(fields[[field]], "[[:space:]]+")[[1L]]
  list(extras = words("Extras"), site = fields[["Site"]], packages = words("Packages"))
}

write_manifest <- function(folder, extras, call) {
  site <- if (is_windows()) {
    file.path("venv", "Lib", "site-packages")
  } else {
    version <- list.files(file.path(folder, "venv", "lib"), "^python")[[1L]]
    file.path("venv", "lib", version, "site-packages")
  }
  packages <- list.files(file.path(folder, site))
  # Names with blanks would be taken for two.
  packages <- packages[!grepl("[[:space:]]", packages)]
  fields <- c(
    Extras = paste(extras, collapse = " "),
    Site = site,
    Packages = paste(packages, collapse = " "),
    End = "yes"
  )
  # Renamed when it is complete, so that no other session reads a part of it.
  path <- file.path(folder, "installed")
  part <- paste0(path, "-")
  try(suppressWarnings({
    writeLines(paste0(names(fields), ": ", fields), part)
    file.rename(part, path)
  }), silent = TRUE)
  if (is.null(read_manifest(folder))) {
    abort_install(
      c(paste0("The file ", path, " cannot be written."),
        i = "Is the disk full? `gym_server_install()` begins anew."),
      call = call
    )
  }
}

# Writes a file by which other sessions know that this one uses a folder.
use_folder <- function(folder) {
  users <- file.path(folder, "used-by")
  dir.create(users, showWarnings = FALSE)
  # It is not needed where it cannot be written: in another user's environment, on a full disk.
  try(suppressWarnings(
    writeLines(Sys.info()[["nodename"]], file.path(users, as.character(Sys.getpid())))
  ), silent = TRUE)
}

# Before a server starts, so that no other session removes what it runs from.
use_python <- function(python) {
  if (is_installed_python(python)) {
    use_folder(folder_of(python))
  }
}

is_installed_python <- function(python) {
  !is.null(python) && startsWith(python, paste0(install_root(), "/"))
}

folder_of <- function(python) dirname(dirname(dirname(python)))

# Removes all folders but one and those that a session uses, which a later installation removes.
remove_other_folders <- function(keep) {
  unlink(renamed_folders(), recursive = TRUE, force = TRUE)
  for (folder in setdiff(install_folders(), keep)) {
    # Without its manifest no session starts a server from it.
    unlink(file.path(folder, "installed"))
    if (!is_used(folder)) {
      remove_folder(folder)
    }
  }
}

remove_folder <- function(folder) {
  if (is_windows()) {
    # Fails while a file in it is in use; deleting would leave half of it.
    renamed <- paste0(folder, renamed_suffix)
    unlink(renamed, recursive = TRUE, force = TRUE)
    if (!suppressWarnings(file.rename(folder, renamed))) {
      return(invisible())
    }
    folder <- renamed
  }
  unlink(folder, recursive = TRUE, force = TRUE)
}

is_used <- function(folder) {
  files <- list.files(file.path(folder, "used-by"), full.names = TRUE)
  any(vapply(files, names_live_session, NA))
}

# Whether a file in the folder used-by is that of a session that still uses the environment.
names_live_session <- function(file) {
  node <- tryCatch(readLines(file, n = 1L), error = function(cnd) "", warning = function(cnd) "")
  if (!identical(node, Sys.info()[["nodename"]])) {
    # Another machine, with the same home on a network, cannot be asked.
    return(difftime(Sys.time(), file.mtime(file), units = "days") < 30)
  }
  pid <- as.integer(basename(file))
  if (pid == Sys.getpid()) {
    return(this_session_uses(dirname(dirname(file))))
  }
  process_runs(pid)
}

this_session_uses <- function(folder) {
  any(vapply(the_session$servers, function(server) {
    is_installed_python(server$python) && folder_of(server$python) == folder &&
      server$process$is_alive()
  }, NA))
}

process_runs <- function(pid) {
  if (is_windows()) {
    # On Windows signal 0 would kill it. There a folder in use cannot be renamed, which is enough.
    return(FALSE)
  }
  tools::pskill(pid, 0L)
}
