# The question whether a server should be started at the address that a script names.

#' Ask whether to start a server where a client found nobody listening
#'
#' For scripts written for the classic client, which name a server on this machine that was to be
#' started by hand. The first request of a client asks, see [prompted_server_starts()]; a session
#' that is not interactive is not asked, nor one that declined for that address before.
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
  # Without a token of its own, as the script's client knows none.
  server <- start_server(
    place$port, options = list(host = place$host), token = FALSE, call = call
  )
  # The script may call the same address by another name, such as localhost.
  the_session$servers[[base]] <- the_session$servers[[server$remote_base]]
  everybody <- if (is.null(server$token)) ", for any account of this machine"
  cli::cli_inform(c(v = "The server at {base} is ready{everybody}. It stops with this R session."))
  TRUE
}

# Whether a client expects a server on this machine where nobody listens. An address behind
# a proxy is not this machine's.
is_vacant <- function(client) {
  base <- client$remote_base
  !is.null(local_place(base)) && is.null(client$config$options$proxy) &&
    !probe_server(base, timeout = 0.3)$listens
}
