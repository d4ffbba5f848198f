# What listens at an address: nothing, a Gym server, or another program.

#' Find out what listens at an address
#'
#' No token is sent, because it may be another program.
#' @param timeout The time for the answer, in seconds. A server that accepts connections but does
#'   not answer in time still counts as listening.
#' @return A list of `listens` and `is_gym` (logical) and `name` (of the program, by its own
#'   account, a string or `NULL`).
#' @noRd
probe_server <- function(base, timeout) {
  client <- new_client(base, timeout, httr::config(forbid_reuse = TRUE))
  response <- tryCatch(
    any_response(client, "/v1/envs/", "GET"), gym_error_connection = function(cnd) NULL
  )
  times <- curl::handle_data(client$state$connection$handles$get$curl)$times
  answer <- response$answer
  list(
    listens = !is.null(response) || times[["connect"]] > 0,
    is_gym = !is.null(answer$all_envs) || identical(answer$code, "unauthorized"),
    name = if (!is.null(response)) server_name(response)
  )
}

#' Say which program has the port of a server
#' @return A sentence, `NULL` if nothing seems to listen there.
#' @noRd
port_holder <- function(base) {
  holder <- probe_server(base, timeout = 2)
  if (!holder$listens) {
    return(NULL)
  }
  use <- paste0("`create_GymClient(\"", base, "\")` talks to it")
  if (is_running(base)) {
    paste0("This session's own server has it: ", use, ".")
  } else if (holder$is_gym) {
    paste0("A Gym server has it: ", use, ".")
  } else if (is.null(holder$name)) {
    "Another program has it. `gym_server_start()` without a port uses a free one."
  } else {
    foreign_server_hint(base, holder$name)
  }
}
