# Opening an address in RStudio's viewer, in a browser, or by the option `gym.viewer`.

#' Open an address for the user
#'
#' By `getOption("gym.viewer")`: a function of an address opens it, also in a script, and `FALSE`
#' opens nothing. Without the option an interactive session opens it in RStudio's viewer,
#' else in the browser.
#' @param address A URL, or the path of a file.
#' @param viewer The option's value, already checked.
#' @return Whether something opened it without an error, logical: a machine may have no browser,
#'   and some browsers fail silently. An error of the option's own function is raised.
#' @noRd
open_address <- function(address, viewer = check_viewer()) {
  if (isFALSE(viewer)) {
    return(FALSE)
  }
  if (is.function(viewer)) {
    viewer(address)
    return(TRUE)
  }
  if (!rlang::is_interactive()) {
    return(FALSE)
  }
  # RStudio's viewer shows what is on this machine.
  elsewhere <- grepl("^https?://", address) && !is_loopback(address)
  usual <- (if (!elsewhere) getOption("viewer")) %||% utils::browseURL
  tryCatch(
    {
      usual(address)
      TRUE
    },
    error = function(cnd) FALSE
  )
}

# Returns the option's value: a function of the address, FALSE for opening nothing, or NULL.
check_viewer <- function(call = rlang::caller_env()) {
  viewer <- getOption("gym.viewer")
  if (!is.null(viewer) && !is.function(viewer) && !isFALSE(viewer)) {
    gym_abort(
      paste0("The option `gym.viewer` must be a function of an address, or FALSE, not ",
             describe_argument(viewer), "."),
      class = "gym_error_argument", argument = "gym.viewer", value = viewer, call = call
    )
  }
  viewer
}
