# The question whether to install a Python for the server, where a server needs one.

#' Install the server's Python environment if somebody agrees
#'
#' Either beforehand, by the environment variable GYM_INSTALL, or now, when asked. A session that
#' declined is not asked again.
#' @return The path of the environment's Python, `NULL` when nobody agreed.
#' @noRd
prompt_for_python <- function() {
  if (tolower(Sys.getenv("GYM_INSTALL")) %in% c("1", "true", "yes")) {
    return(keep_random_state(gym_server_install(ask = FALSE)))
  }
  if (!rlang::is_interactive() || isTRUE(the_session$install_declined)) {
    return(NULL)
  }
  # Processes get names that are drawn from R's generator.
  python <- keep_random_state(gym_server_install(ask = TRUE))
  the_session$install_declined <- is.null(python)
  python
}
