# One session installs at a time. A folder is the sign of whose turn it is, as making one
# succeeds for one session only; its holder touches it again and again, so that the sign of a
# session that was killed is known by its age, also where another process has its number by now:
# after a reboot, in a container. Nothing depends on it but time and disk space:
# sessions that install at once, in spite of all, make folders of their own.

turn_folder <- function() file.path(install_root(), "installing")

turn_owner <- function() file.path(turn_folder(), "owner")

# Seconds after which a sign that nobody touched is void. Tools and downloads touch it again and
# again, and no program that is only asked something may take longer.
turn_patience <- 120

#' Evaluate an expression when it is this session's turn
#' @noRd
in_turn <- function(code, call = rlang::caller_env()) {
  wait_for_turn(call)
  the_session$has_turn <- TRUE
  on.exit({
    the_session$has_turn <- FALSE
    # Another session's when this one was taken for dead, as on a computer that slept.
    if (identical(read_turn_owner() %||% own_name(), own_name())) {
      unlink(turn_folder(), recursive = TRUE)
    }
  })
  force(code)
}

wait_for_turn <- function(call) {
  said <- FALSE
  refused <- 0
  dir.create(install_root(), recursive = TRUE, showWarnings = FALSE)
  while (!dir.create(turn_folder(), showWarnings = FALSE)) {
    # Where there is none, its holder has just ended; or none can be made.
    refused <- if (dir.exists(turn_folder())) 0 else refused + 1
    if (refused > 20) {
      abort_folder(install_root(), call)
    }
    if (turn_is_void()) {
      unlink(turn_folder(), recursive = TRUE)
    } else {
      if (refused == 0 && !said) {
        cli::cli_inform("Another R session is installing the server: waiting until it is done.")
        said <- TRUE
      }
      Sys.sleep(if (refused) 0.05 else 0.5)
    }
  }
  # Without it, on a full disk, the folder itself tells the age.
  try(suppressWarnings(
    writeLines(own_name(), turn_owner())
  ), silent = TRUE)
}

own_name <- function() c(Sys.info()[["nodename"]], as.character(Sys.getpid()))

# NULL when it cannot be read, or not yet.
read_turn_owner <- function() {
  owner <- tryCatch(
    readLines(turn_owner()),
    error = function(cnd) NULL, warning = function(cnd) NULL
  )
  if (length(owner) == 2L) owner
}

# While a tool works.
keep_turn <- function() {
  if (isTRUE(the_session$has_turn)) {
    Sys.setFileTime(turn_sign(), Sys.time())
  }
}

turn_sign <- function() if (file.exists(turn_owner())) turn_owner() else turn_folder()

turn_is_void <- function() {
  owner <- read_turn_owner()
  if (identical(owner, own_name()) && !isTRUE(the_session$has_turn)) {
    return(TRUE)
  }
  # Windows cannot be asked whether a process runs without other packages.
  if (identical(owner[1L], own_name()[1L]) && !is_windows() &&
        !process_runs(as.integer(owner[[2L]]))) {
    return(TRUE)
  }
  touched <- file.mtime(turn_sign())
  !is.na(touched) && difftime(Sys.time(), touched, units = "secs") > turn_patience
}
