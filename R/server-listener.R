# What listens at an address: nothing, a Gym server, or another program.

#' Find out what listens at an address
#'
#' Calls a route that every Gym server has, including a classic one.
#' @param timeout The time for the answer, in seconds. A server that accepts connections but does
#'   not answer in time still counts as listening.
#' @param token The token of a server that is known to be ours. Other programs get none.
#' @return A list of `listens`, `is_gym` and `asks_token` (whether it needs a token, or another one;
#'   all three are logical), `status` (of the answer), `name` (of the program, by its own account, a
#'   string or `NULL`), `instances` (their number on a Gym server) and `problem` (why there is no
#'   answer, a string or `NULL`).
#' @noRd
probe_server <- function(base, timeout, token = NULL) {
  client <- new_client(base, timeout, httr::config(forbid_reuse = TRUE), token)
  problem <- NULL
  response <- tryCatch(
    any_response(client, "/v1/envs/", "GET"),
    gym_error_connection = function(cnd) {
      problem <<- conditionMessage(cnd)
      NULL
    }
  )
  times <- curl::handle_data(client$state$connection$handles$get$curl)$times
  envs <- response$answer$all_envs
  asks_token <- identical(response$answer$code, "unauthorized")
  list(
    listens = !is.null(response) || times[["connect"]] > 0,
    is_gym = !is.null(envs) || asks_token,
    status = response$status_code,
    asks_token = asks_token,
    name = if (!is.null(response)) server_name(response),
    instances = length(envs),
    problem = problem
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
