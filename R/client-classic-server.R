# Servers that know the protocol of gym-http-api alone, as the original one does. They tell less of
# an environment, ignore fields that they do not know, and do a repeated request a second time.

# A newer server echoes the request's number in its answer, here that to a creation.
note_protocol <- function(state, answer) state$classic <- is.null(answer$request)

#' Describe an instance by what the classic protocol tells of it
#'
#' @param missing The condition by which the server said that it has no route for this.
#' @return A list, as a newer server's answer.
#' @noRd
classic_description <- function(x, instance_id, missing, call) {
  if (!is.null(missing$code)) {
    rlang::cnd_signal(missing)
  }
  route <- instance_route(instance_id)
  description <- list(
    classic = TRUE,
    action_space = get_answer(x, paste0(route, "action_space/"), call = call)$info,
    observation_space = get_answer(x, paste0(route, "observation_space/"), call = call)$info,
    env_id = get_answer(x, "/v1/envs/", call = call)$all_envs[[instance_id]]
  )
  state <- connection(x)
  state$classic <- TRUE
  description
}

# The protocol tells only that an episode is done; environments of its time say in the info where
# a limit of steps was the reason.
classic_flags <- function(answer) {
  done <- isTRUE(answer$done)
  answer$truncated <- done && isTRUE(answer$info[["TimeLimit.truncated"]])
  answer$terminated <- done && !answer$truncated
  answer
}

# A newer server's create and reset have more arguments. `fields` are those of the request.
check_classic_fields <- function(x, fields, known, call) {
  ignored <- setdiff(names(fields), known)
  if (length(ignored)) {
    name <- sub("^reset_", "", ignored[[1L]])
    gym_abort(
      c(
        paste0("The server at ", x$remote_base, " knows the protocol of gym-http-api alone, ",
               "which has no `", name, "` here."),
        i = "`gym_server_start()` starts a server that has it."
      ),
      class = "gym_error_http", code = "not_supported", call = call
    )
  }
}

# Spaces of which the server tells no more than the name -------------------------------------

# The classic protocol describes these two.
new_classic_space <- function(description) {
  if (isTRUE(description$name %in% c("Discrete", "Box"))) {
    return(new_space(description))
  }
  structure(list(name = description$name), class = c("gym_space_undescribed", "gym_space"))
}

#' @exportS3Method
space_text.gym_space_undescribed <- function(space) paste(space$name, "(not described)")

#' @exportS3Method
decode_value.gym_space_undescribed <- function(space, json) info_from_json(json)

#' @exportS3Method
check_value.gym_space_undescribed <- function(space, value, path, call, bounds = FALSE) {
  if (bounds) {
    abort_undescribed(space, call)
  }
}

#' @exportS3Method
write_value.gym_space_undescribed <- function(space, value) to_json(value)

#' @exportS3Method
space_sample.gym_space_undescribed <- function(space) abort_undescribed(space)

abort_undescribed <- function(space, call = rlang::caller_env()) {
  gym_abort(
    paste0("The server tells no more of this space than its name, ", space$name, "."),
    class = "gym_error_argument", argument = "space", value = space, call = call
  )
}
