# Where the server's Python environments lie. Each installation makes a folder of its own, and
# nothing that was installed is changed afterwards: a server that another session runs loses
# nothing, and an interrupted installation leaves what was there before.
#
#   <cache>/gym/<lock's hash>-<number>/venv         the environment
#                                     /installed    the marker, written last: what is in it
#                                     /used-by/PID  the R sessions that use it or are making it

install_root <- function() cache_of("gym")

cache_of <- function(package) absolute_path(tools::R_user_dir(package, "cache"))

# Tools run elsewhere and take "~" literally. normalizePath() would say another path once it
# exists, where a folder above is a link.
absolute_path <- function(path) {
  path <- path.expand(path)
  if (is_windows()) {
    path <- chartr("\\", "/", path)
  }
  if (grepl("^(/|[A-Za-z]:/)", path)) path else file.path(getwd(), path)
}

install_folders <- function() {
  folders <- list.files(install_root(), "^[0-9a-f]{12}-[0-9]+$", full.names = TRUE)
  folders[order(folder_number(folders), decreasing = TRUE)]
}

# Of what could be renamed, but not deleted yet.
given_up_end <- "-old"

given_up_folders <- function() {
  pattern <- paste0("^[0-9a-f]{12}-[0-9]+", given_up_end, "$")
  list.files(install_root(), pattern, full.names = TRUE)
}

folder_number <- function(folders) as.integer(sub(".*-", "", basename(folders)))

next_folder <- function() {
  number <- max(0L, folder_number(install_folders())) + 1L
  file.path(install_root(), paste0(lock_hash(), "-", number))
}

# A folder that no other session takes, should it make one at the same time.
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

# At the end: what is not whole goes, and the mark that this session made.
leave_folder <- function(folder, whole) {
  unlink(file.path(folder, "used-by", as.character(Sys.getpid())))
  if (!whole) {
    remove_folder(folder)
  }
}

environment_python <- function(folder) {
  file.path(folder, "venv", if (is_windows()) "Scripts/python.exe" else "bin/python")
}

#' Find the installed environment
#'
#' An environment is whole when its marker is there, which is written last, and holds what the
#' marker names: a Python or package that somebody deleted is noticed.
#' @return `NULL`, or a list: `python`, the path of its Python; `folder`, its folder; `extras`,
#'   the extras that it holds.
#' @noRd
installed_server <- function() {
  hash <- lock_hash()
  for (folder in install_folders()) {
    marker <- if (startsWith(basename(folder), hash)) read_marker(folder)
    if (!is.null(marker) && environment_is_whole(folder, marker)) {
      return(list(
        python = environment_python(folder), folder = folder, extras = marker$extras
      ))
    }
  }
  NULL
}

environment_is_whole <- function(folder, marker) {
  file.exists(environment_python(folder)) &&
    all(marker$packages %in% list.files(file.path(folder, marker$site)))
}

# The extras that were installed last, also for an earlier lock.
earlier_extras <- function() {
  for (folder in install_folders()) {
    marker <- read_marker(folder)
    if (!is.null(marker)) {
      return(intersect(marker$extras, server_extras))
    }
  }
  character()
}

read_marker <- function(folder) {
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

write_marker <- function(folder, extras, call) {
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
  # Whole at once, or not at all.
  path <- file.path(folder, "installed")
  part <- paste0(path, "-")
  try(suppressWarnings({
    writeLines(paste0(names(fields), ": ", fields), part)
    file.rename(part, path)
  }), silent = TRUE)
  if (is.null(read_marker(folder))) {
    abort_install(
      c(paste0("The file ", path, " cannot be written."),
        i = "Is the disk full? `gym_server_install()` begins anew."),
      call = call
    )
  }
}

# Note that this session uses a folder.
use_folder <- function(folder) {
  marks <- file.path(folder, "used-by")
  dir.create(marks, showWarnings = FALSE)
  # Another user's environment needs no mark, and a full disk has worse troubles.
  try(suppressWarnings(
    writeLines(Sys.info()[["nodename"]], file.path(marks, as.character(Sys.getpid())))
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

# Remove all folders but one, as far as no session uses them: the rest is for the next time.
remove_other_folders <- function(keep) {
  unlink(given_up_folders(), recursive = TRUE, force = TRUE)
  for (folder in setdiff(install_folders(), keep)) {
    # From here on nobody takes it for an environment.
    unlink(file.path(folder, "installed"))
    if (!is_used(folder)) {
      remove_folder(folder)
    }
  }
}

remove_folder <- function(folder) {
  if (is_windows()) {
    # Fails while a file in it is in use; deleting would leave half of it.
    given_up <- paste0(folder, given_up_end)
    unlink(given_up, recursive = TRUE, force = TRUE)
    if (!suppressWarnings(file.rename(folder, given_up))) {
      return(invisible())
    }
    folder <- given_up
  }
  unlink(folder, recursive = TRUE, force = TRUE)
}

is_used <- function(folder) {
  marks <- list.files(file.path(folder, "used-by"), full.names = TRUE)
  any(vapply(marks, mark_holds, NA))
}

mark_holds <- function(mark) {
  node <- tryCatch(readLines(mark, n = 1L), error = function(cnd) "", warning = function(cnd) "")
  if (!identical(node, Sys.info()[["nodename"]])) {
    # Of another machine nothing is known: a home on a network.
    return(difftime(Sys.time(), file.mtime(mark), units = "days") < 30)
  }
  pid <- as.integer(basename(mark))
  if (pid == Sys.getpid()) {
    return(this_session_uses(dirname(dirname(mark))))
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
    # There a signal 0 would end it; renaming its folder tells whether it is in use.
    return(FALSE)
  }
  tools::pskill(pid, 0L)
}
