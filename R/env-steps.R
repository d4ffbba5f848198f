# Resets and steps of an instance: check and write the arguments, perform the request, and read,
# check and name the result. The request is prepared once for each combination of a call's flags.

#' Start an episode
#' @param named Whether observations have names: those of the classic calls do not.
#' @param infos Whether the server makes infos.
#' @noRd
reset_instance <- function(instance, seed, options, return_info = FALSE, mask = NULL,
                           named = FALSE, infos = TRUE, call = rlang::caller_env()) {
  client <- instance$client
  close_queued(client)
  fields <- c(
    seed = encode_seed(seed, instance$num_envs, call),
    options = if (!is.null(options)) {
      check_named_list(options, call = call)
      to_json(options)
    },
    reset_mask = mask_json(mask, instance, call)
  )
  # A place for each combination of the flags.
  slot <- 1L + named + 2L * infos
  request <- instance$resets[[slot]]
  if (is.null(request)) {
    request <- list2env(prepare_reset(instance, named, infos), parent = emptyenv())
    instance$resets[[slot]] <- request
  }
  stream <- stream_of(instance)
  message <- if (!is.null(stream$con) && !stream$busy) {
    request$message %||% keep_message(request, reset_message(instance, request, stream, named))
  }
  content <- json_members(fields)
  result <- if (is.list(message)) {
    body <- request$body(content, NULL)
    ask_stream(stream, message, body, message_head(length(body), 1L, 1L), call)
  }
  result <- if (is.list(result)) {
    result[[1L]]
  } else {
    perform_request(request, content, call, key = stream_key(stream, result))
  }
  instance$done <- FALSE
  if (return_info) result else result$observation
}

prepare_reset <- function(instance, named, infos) {
  read_observation <- observation_reader(instance, instance$observations, named)
  read <- function(answer) {
    info <- read_info(answer, instance$num_envs)
    list(observation = read_observation(answer), info = info)
  }
  prepare_instance_request(instance, "reset/", info_field(infos), named, read)
}

#' Take a step
#' @inheritParams reset_instance
#' @param finals Whether the server sends the last observations of episodes after which another one
#'   began.
#' @param check_ended Raises an error if the environment has ended with its server. It is evaluated
#'   if there is no answer.
#' @noRd
step_instance <- function(instance, action, which = NULL, render = FALSE, named = FALSE,
                          infos = TRUE, finals = TRUE, call = rlang::caller_env(),
                          check_ended = NULL) {
  slot <- 1L + named + 2L * infos + 4L * render + 8L * finals
  request <- instance$steps[[slot]]
  if (is.null(request) || !identical(request$which, which)) {
    check_which(which, instance, call)
    request <- list2env(
      prepare_step(instance, which, render, named, infos, finals), parent = emptyenv()
    )
    instance$steps[[slot]] <- request
  }
  # The action may itself take a step: evaluate it first.
  force(action)
  stream <- stream_of(instance)
  message <- if (!is.null(stream$con) && !stream$busy) {
    if (is.null(request$message)) {
      keep_message(
        request, step_message(instance, request, stream, render, named, infos, finals)
      )
    } else {
      request$message
    }
  }
  result <- if (is.list(message)) {
    content <- message$write(action)
    head <- message$head
    if (is.null(content)) {
      content <- request$body(request$check_and_write(action, call), NULL)
      head <- message_head(length(content), 0L, 1L + instance$sends_tensors)
    }
    ask_stream(stream, message, content, head, call)
  }
  result <- if (is.list(result)) {
    result[[1L]]
  } else {
    content <- request$write(action) %||% request$check_and_write(action, call)
    withCallingHandlers(
      perform_request(request, content, call, key = stream_key(stream, result)),
      gym_error_connection = function(cnd) check_ended
    )
  }
  # NA: the episode is over, and the warning has been given.
  if (is.null(instance$num_envs) && !is.na(instance$done)) {
    if (instance$done) {
      instance$done <- NA
      warn_step_after_end(paste("Instance", instance$id, "of", instance$spec$id), call)
    } else {
      instance$done <- result$done
    }
  }
  result
}

prepare_step <- function(instance, which, render, named, infos, finals) {
  fields <- c(
    render = if (render) "true" else "false", info_field(infos),
    final_obs = if (!finals) "false"
  )
  if (is.null(instance$num_envs)) {
    prepare_single_step(instance, fields, named)
  } else {
    prepare_vector_step(instance, fields, which, named, infos)
  }
}

# The field that tells a server to make no infos.
info_field <- function(infos) if (!infos) c(info = "false")

#' Prepare the requests to one of an instance's routes
#' @param body,sends_tensors As for [prepare_request()].
#' @param read_answer A function of a parsed answer, which returns the result or raises an error.
#' @noRd
prepare_instance_request <- function(instance, route, fields, named, read_answer,
                                     body = new_json_body(fields), sends_tensors = FALSE) {
  read <- if (instance$takes_tensors) {
    space <- instance$single_observation_space
    labels <- if (named && inherits(space, "gym_space_box")) space$names
    new_tensors_reader(read_answer, labels)
  } else {
    new_json_reader(read_answer)
  }
  prepare_request(
    instance$client, paste0(instance$route, route), body = body, sends_tensors = sends_tensors,
    takes_tensors = instance$takes_tensors || sends_tensors, once = TRUE, read = read,
    result = read_answer
  )
}

# Steps of a single environment --------------------------------------------------------------

prepare_single_step <- function(instance, fields, named) {
  actions <- instance$actions
  sends <- instance$sends_tensors
  read_observation <- observation_reader(instance, instance$observations, named)
  request <- prepare_instance_request(
    instance, "step/", fields, named, step_reader(instance, read_observation),
    body = if (sends) new_tensors_body(fields) else new_json_body(fields),
    sends_tensors = sends
  )
  request$write <- if (sends) function(action) NULL else json_writer(actions)
  request$check_and_write <- function(action, call) {
    action <- numbered_actions(instance, action, call)
    action <- action_by_name(instance$single_action_space, action, instance$spec$id, call)
    check_value(actions, action, "", call)
    if (sends) {
      to_tensors(actions, action, "action", call)
    } else {
      paste0('"action":', write_value(actions, action), ",")
    }
  }
  request
}

# Makes the function that reads the answer to a step of a single environment.
step_reader <- function(instance, read_observation) {
  function(answer) {
    if (!is.null(answer$tensors)) {
      check_answer_results(answer$tensors, 1L)
      answer[flags_and_reward] <- answer$tensors[flags_and_reward]
      answer$done <- answer$terminated || answer$truncated
    }
    for (name in c("done", "terminated", "truncated")) {
      flag <- answer[[name]]
      if (!isTRUE(flag) && !isFALSE(flag)) refuse_field(flag, name, "true or false")
    }
    info <- read_info(answer, NULL)
    observation <- read_observation(answer)
    reward <- answer$reward
    if (!is.double(reward) || length(reward) != 1L) reward <- number_from(reward, "reward")
    list(
      observation = observation, reward = reward, done = answer$done, info = info,
      terminated = answer$terminated, truncated = answer$truncated
    )
  }
}

flags_and_reward <- c("reward", "terminated", "truncated")

# Observations -------------------------------------------------------------------------------

#' Make the function that reads an answer's observations
#' @param space The observation space.
#' @param name The answer's field, or the name of its tensors.
#' @return A function of a parsed answer.
#' @noRd
observation_reader <- function(instance, space, named, name = "observation") {
  read_json <- json_reader(space)
  name_observation <- if (named) instance$name_observation
  in_one <- inherits(space, c("gym_space_array", "gym_space_discrete"))
  shape <- if (length(space$shape) > 1L) space$shape
  n <- prod(space$shape)
  read_any <- function(answer) {
    if (is.null(answer$tensors)) {
      decode_value(space, answer[[name]])
    } else {
      from_tensors(space, name, answer)
    }
  }
  function(answer) {
    # The usual form, or NULL.
    observation <- if (is.null(answer$tensors)) {
      read_json(answer[[name]])
    } else if (in_one) {
      values <- answer$tensors[[name]]
      if (length(values) == n && identical(dim(values), shape)) values
    }
    observation <- observation %||% read_values(read_any(answer), paste0("Its `", name, "`"))
    if (is.null(name_observation) || isTRUE(answer$named)) {
      observation
    } else {
      name_observation(observation)
    }
  }
}

# The info of an answer. `n` is the number of sub-environments, `NULL` for a single environment.
read_info <- function(answer, n) {
  info <- answer$info
  if (!length(info)) {
    return(empty_object)
  }
  check_optional(answer, "info", is_object, "an object")
  if (is.null(n)) info_from_json(info) else read_values(info_by_sub_env(info, n), "Its `info`")
}
