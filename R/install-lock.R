# The install lock, by which one session installs at a time. It is a folder, as making a folder
# succeeds for one session only, with a file in it that names its owner. The owner touches the file
# again and again, so that the lock of a session that was killed is known by its age; its process
# number alone does not tell, as after a reboot or in a container another process may have it.
# The lock saves time and disk space, no more: sessions that install at once nevertheless make
# folders of their own.

install_lock <- function() file.path(install_root(), "installing")

install_lock_owner <- function() file.path(install_lock(), "owner")

# Seconds after which a lock that nobody touched is stale. Tools and downloads touch it again and
# again, and no program that is only asked something may take longer.
install_lock_timeout <- 120

#' Evaluate an expression while this session holds the install lock
#' @noRd
with_install_lock <- function(code, call = rlang::caller_env()) {
  wait_for_install_lock(call)
  the_session$holds_install_lock <- TRUE
  on.exit({
    the_session$holds_install_lock <- FALSE
    # Another session has it when this one was taken for dead, as on a computer that slept.
    if (identical(read_lock_owner() %||% own_name(), own_name())) {
      unlink(install_lock(), recursive = TRUE)
    }
  })
  force(code)
}

wait_for_install_lock <- function(call) {
  informed <- FALSE
  refused <- 0
  dir.create(install_root(), recursive = TRUE, showWarnings = FALSE)
  while (!dir.create(install_lock(), showWarnings = FALSE)) {
    # No lock is there now: its owner has just released it, or no folder can be made here.
    refused <- if (dir.exists(install_lock())) 0 else refused + 1
    if (refused > 20) {
      abort_folder(install_root(), call)
    }
    if (install_lock_is_stale()) {
      unlink(install_lock(), recursive = TRUE)
    } else {
      if (refused == 0 && !informed) {
        cli::cli_inform("Another R session is installing the server: waiting until it is done.")
        informed <- TRUE
      }
      Sys.sleep(if (refused) 0.05 else 0.5)
    }
  }
  # Where it cannot be written, as on a full disk, the age of the folder stands for its own.
  try(suppressWarnings(
    writeLines(own_name(), install_lock_owner())
  ), silent = TRUE)
}

own_name <- function() c(Sys.info()[["nodename"]], as.character(Sys.getpid()))

# Returns NULL when the owner cannot be read, or has not written its name yet.
read_lock_owner <- function() {
  owner <- tryCatch(
    readLines(install_lock_owner()),
    error = function(cnd) NULL, warning = function(cnd) NULL
  )
  if (length(owner) == 2L) owner
}

# Keeps this session's lock from growing stale while a tool works.
touch_install_lock <- function() {
  if (isTRUE(the_session$holds_install_lock)) {
    Sys.setFileTime(touched_file(), Sys.time())
  }
}

touched_file <- function() {
  if (file.exists(install_lock_owner())) install_lock_owner() else install_lock()
}

install_lock_is_stale <- function() {
  owner <- read_lock_owner()
  if (identical(owner, own_name()) && !isTRUE(the_session$holds_install_lock)) {
    return(TRUE)
  }
  # On Windows only other packages can tell whether a process runs.
  if (identical(owner[1L], own_name()[1L]) && !is_windows() &&
        !process_runs(as.integer(owner[[2L]]))) {
    return(TRUE)
  }
  touched <- file.mtime(touched_file())
  !is.na(touched) && difftime(Sys.time(), touched, units = "secs") > install_lock_timeout
}
