# Ask whether to start a server at the address that a script names.

#' Ask whether to start a server if nobody listens at a client's address
#'
#' For scripts written for the classic client, whose users started a server on this machine by hand.
#' The first request of a client asks, see [prompted_server_starts()]. It does not ask in a session
#' that is not interactive, nor again after a "no" for this address.
#' @return Whether a server was started.
#' @noRd
prompt_for_server <- function(client, call = rlang::caller_env()) {
  base <- client$remote_base
  if (!rlang::is_interactive() || base %in% the_session$start_declined || !is_vacant(client)) {
    return(FALSE)
  }
  if (!ask_yes_no(paste0("No server runs at ", base, ". Start one there?"), TRUE, call = call)) {
    the_session$start_declined <- c(the_session$start_declined, base)
    return(FALSE)
  }
  place <- local_place(base)
  # Without a token: the script's client has none.
  server <- start_server(
    place$port, options = list(host = place$host), token = FALSE, call = call
  )
  # The script may use another name for the same address, such as localhost.
  the_session$servers[[base]] <- the_session$servers[[server$remote_base]]
  everybody <- if (is.null(server$token)) ", for any account of this machine"
  cli::cli_inform(c(v = "The server at {base} is ready{everybody}. It stops with this R session."))
  TRUE
}

# Whether a client expects a server on this machine and nobody listens there. An address behind a
# proxy is not on this machine.
is_vacant <- function(client) {
  base <- client$remote_base
  !is.null(local_place(base)) && is.null(client$config$options$proxy) &&
    !probe_server(base, timeout = 0.3)$listens
}
