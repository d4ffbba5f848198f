# What a session is offered when something is missing that the package can bring: the
# server's Python environment, and a server at the address that a script names. Nothing
# is offered where nobody can answer.

#' Install the server's Python environment if somebody says so
#'
#' Either beforehand, by the environment variable GYM_INSTALL, or now, when asked. Who
#' declines is not asked again in the same session.
#' @return The path of the environment's Python, `NULL` when nobody said so.
#' @noRd
offered_python <- function() {
  if (install_allowed()) {
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

install_allowed <- function() tolower(Sys.getenv("GYM_INSTALL")) %in% c("1", "true", "yes")

#' Offer to start a server where a client expects one
#'
#' For scripts written for the classic client, which name a server on this machine that was
#' to be started by hand. Who declines is not asked again for that address.
#' @noRd
offer_server <- function(client, call = rlang::caller_env()) {
  base <- client$remote_base
  if (!rlang::is_interactive() || base %in% the_session$start_declined || !is_vacant(client)) {
    return(invisible())
  }
  if (!ask_yes_no(paste0("No server runs at ", base, ". Start one there?"), TRUE, call = call)) {
    the_session$start_declined <- c(the_session$start_declined, base)
    return(invisible())
  }
  place <- local_place(base)
  server <- start_server(place$port, options = list(host = place$host), call = call)
  # Under the name that the script has for it, too.
  the_session$servers[[base]] <- the_session$servers[[server$remote_base]]
  cli::cli_inform(c(v = "The server at {base} is ready. It stops with this R session."))
}

# Whether a client expects a server on this machine where nobody listens. An address behind
# a proxy is not this machine's.
is_vacant <- function(client) {
  base <- client$remote_base
  !is.null(local_place(base)) && is.null(client$config$options$proxy) &&
    !probe_server(base, timeout = 0.3)$listens
}
