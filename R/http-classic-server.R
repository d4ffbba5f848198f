# Servers with only the protocol of gym-http-api, such as the original one. They say less about an
# environment, ignore unknown fields, and execute a repeated request twice.

# A newer server repeats the idempotency key in its answer, and says by a text which server it is.
# `answer` is the answer to a creation.
note_protocol <- function(state, answer) {
  state$classic <- is.null(answer$request)
  state$server <- string_or_null(answer$server)
}

#' Describe an instance from the data of the classic protocol
#'
#' @param missing The server's error that it has no route for the full description.
#' @return A list like a newer server's answer.
#' @noRd
classic_description <- function(client, instance_id, missing, call) {
  if (!is.null(missing$code)) {
    rlang::cnd_signal(missing)
  }
  route <- instance_route(instance_id)
  description <- list(
    classic = TRUE,
    action_space = get_answer(client, paste0(route, "action_space/"), call = call)$info,
    observation_space = get_answer(client, paste0(route, "observation_space/"), call = call)$info,
    env_id = get_answer(client, "/v1/envs/", call = call)$all_envs[[instance_id]]
  )
  note_protocol(client_state(client), description)
  description
}

# Splits `done` into `terminated` and `truncated`: the protocol has only `done`, and environments of
# its time note in the info that a step limit was the reason.
classic_flags <- function(answer) {
  done <- isTRUE(answer$done)
  answer$truncated <- done && isTRUE(answer$info[["TimeLimit.truncated"]])
  answer$terminated <- done && !answer$truncated
  answer
}

# Refuses the fields of a request that only newer servers know; a classic one would ignore them.
check_classic_fields <- function(client, fields, known, call) {
  ignored <- setdiff(names(fields), known)
  if (length(ignored)) {
    name <- sub("^reset_", "", ignored[[1L]])
    abort_classic(client, paste0("no `", name, "` here"), call)
  }
}

abort_classic <- function(client, lacks, call) {
  gym_abort(
    c(
      paste0("The server at ", client$remote_base, " has only the protocol of gym-http-api, ",
             "which has ", lacks, "."),
      i = "`gym_server_start()` starts a newer server."
    ),
    class = "gym_error_http", code = "not_supported", call = call
  )
}
