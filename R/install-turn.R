# One session installs at a time. A folder is the sign of whose turn it is, as making one
# succeeds for one session only; its holder touches it again and again, so that the sign of a
# session that was killed is known by its age. Nothing depends on it but time and disk space:
# sessions that install at once, in spite of all, make folders of their own.

turn_folder <- function() file.path(install_root(), "installing")

turn_owner <- function() file.path(turn_folder(), "owner")

# Seconds after which a sign that nobody touched is void: downloads are touched twice a second,
# but a computer may be busy.
turn_patience <- 60

#' Evaluate an expression when it is this session's turn
#' @noRd
in_turn <- function(code) {
  wait_for_turn()
  on.exit(end_turn())
  force(code)
}

wait_for_turn <- function() {
  said <- FALSE
  dir.create(install_root(), recursive = TRUE, showWarnings = FALSE)
  while (!dir.create(turn_folder(), showWarnings = FALSE)) {
    if (!dir.exists(install_root())) {
      abort_cache_folder()
    }
    if (turn_is_void()) {
      unlink(turn_folder(), recursive = TRUE)
      next
    }
    if (!said) {
      cli::cli_inform("Another R session is installing the server: waiting until it is done ...")
      said <- TRUE
    }
    Sys.sleep(0.5)
  }
  writeLines(c(Sys.info()[["nodename"]], Sys.getpid()), turn_owner())
}

end_turn <- function() unlink(turn_folder(), recursive = TRUE)

keep_turn <- function() {
  if (file.exists(turn_owner())) Sys.setFileTime(turn_owner(), Sys.time())
}

turn_is_void <- function() {
  owner <- tryCatch(readLines(turn_owner()), error = function(cnd) NULL, warning = function(cnd) NULL)
  if (length(owner) == 2L && owner[[1L]] == Sys.info()[["nodename"]] && !is_windows()) {
    return(!process_runs(as.integer(owner[[2L]])))
  }
  touched <- file.mtime(if (length(owner)) turn_owner() else turn_folder())
  !is.na(touched) && difftime(Sys.time(), touched, units = "secs") > turn_patience
}
