# Resets and steps of an instance: check and write the arguments, send the request, and read, check
# and name the result. A request is prepared once for each combination of a call's flags.

#' Start an episode
#' @param named Whether observations get names. The classic calls return them without names.
#' @param infos Whether the server makes infos.
#' @noRd
reset_instance <- function(instance, seed, options, return_info = FALSE, mask = NULL,
                           named = FALSE, infos = TRUE, call = rlang::caller_env()) {
  close_queued(instance$client)
  fields <- c(
    seed = encode_seed(seed, instance$num_envs, call),
    options = if (!is.null(options)) {
      check_named_list(options, call = call)
      to_json(options)
    },
    reset_mask = mask_json(mask, instance, call)
  )
  # Each combination of the flags has its own slot.
  slot <- 1L + named + 2L * infos
  request <- instance$resets[[slot]]
  if (is.null(request)) {
    request <- instance$resets[[slot]] <- prepare_reset(instance, named, infos)
  }
  result <- ask_instance(instance, request, fields, call)
  instance$done <- FALSE
  if (return_info) result else result$observation
}

prepare_reset <- function(instance, named, infos) {
  name_observation <- if (named) instance$name_observation
  rlang::env(
    sends_tensors = FALSE, fields = info_field(infos),
    content = function(fields, call) fields,
    read = function(answer) {
      n <- instance$num_envs
      observation <- read_observation(instance$observations, answer, name_observation)
      list(observation = observation, info = read_info(answer, n))
    },
    new_message = function(request, layout) reset_message(instance, request, layout, named)
  )
}

#' Take a step
#' @inheritParams reset_instance
#' @param finals Whether the server sends the last observation of an episode if the next one began
#'   in the same step.
#' @param check_ended An expression that raises an error if the environment has ended with its
#'   server. It is evaluated only if no answer comes.
#' @noRd
step_instance <- function(instance, action, which = NULL, render = FALSE, named = FALSE,
                          infos = TRUE, finals = TRUE, call = rlang::caller_env(),
                          check_ended = NULL) {
  slot <- 1L + named + 2L * infos + 4L * render + 8L * finals
  request <- instance$steps[[slot]]
  if (is.null(request) || !identical(request$which, which)) {
    check_which(which, instance, call)
    request <- prepare_step(instance, which, render, named, infos, finals)
    instance$steps[[slot]] <- request
  }
  # The action may itself take a step: evaluate it first.
  force(action)
  result <- ask_instance(instance, request, action, call, check_ended)
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

#' Prepare a kind of steps
#' @return An environment for [ask_instance()].
#' @noRd
prepare_step <- function(instance, which, render, named, infos, finals) {
  n <- instance$num_envs
  selects <- length(which) && length(which) < n
  # The number of sub-environments that step.
  if (selects) n <- length(which)
  single <- instance$single_action_space
  actions <- sent_space(single, n)
  observed <- sent_space(instance$single_observation_space, n)
  name_observation <- if (named) instance$name_observation
  rlang::env(
    sends_tensors = instance$sends_tensors, which = which,
    fields = c(
      render = if (render) "true" else "false", info_field(infos),
      final_obs = if (!finals) "false",
      step_mask = if (selects) json_array(json_atoms(seq_len(instance$num_envs) %in% which))
    ),
    content = function(action, call) {
      action <- numbered_actions(instance, action, call)
      action <- action_by_name(single, action, instance$spec$id, call)
      if (is.null(n)) {
        check_value(single, action, "", call)
      } else {
        check_batch(single, actions, action, n, call, which)
      }
      if (instance$sends_tensors) {
        to_tensors(actions, action, "action", call)
      } else {
        c(action = if (is.null(n)) write_value(single, action) else write_batch(single, action, n))
      }
    },
    read = function(answer) read_step(instance, observed, answer, n, name_observation, infos),
    new_message = function(request, layout) {
      step_message(instance, request, layout, n, render, named, infos, finals)
    }
  )
}

#' Ask an instance for a reset or a step, by its stream or by HTTP
#'
#' @param request An environment with three functions: `new_message` describes the fast messages,
#'   see [step_message()]; `content` checks a value that such a message cannot write, and returns
#'   the fields of a body, or tensors; `read` returns the result of an answer that such a message
#'   cannot read. It also has the constant `fields` of the body (JSON texts), and whether it
#'   `sends_tensors`.
#' @param value The action, or the fields of a reset.
#' @noRd
ask_instance <- function(instance, request, value, call, check_ended = NULL) {
  stream <- stream_of(instance)
  by_http <- function(answer) {
    withCallingHandlers(answer, gym_error_connection = function(cnd) check_ended)
  }
  message <- request$message
  if (is.null(message)) {
    layout <- by_http(message_layout(stream, call))
    message <- request$message <- request$new_message(request, layout)
  }
  content <- message$write(value)
  head <- message$head
  if (is.null(content)) {
    content <- request_body(request, request$content(value, call))
    head <- message_head(length(content), message$what, 1L + request$sends_tensors)
  }
  result <- if (!is.null(stream$con) && !stream$busy) {
    ask_stream(stream, message, content, head, call)
  }
  if (is.list(result)) {
    return(result[[1L]])
  }
  by_http(post_message(stream, message, content, head, result, call))
}

# The body of a message whose value is not sent as plain arrays.
request_body <- function(request, content) {
  if (!request$sends_tensors) {
    return(json_body(c(content, request$fields)))
  }
  texts <- vapply(content, is.character, NA)
  write_tensors(
    content[!texts], c(request$fields, texts = if (any(texts)) to_json(content[texts]))
  )
}

# The field that tells a server to make no infos.
info_field <- function(infos) if (!infos) c(info = "false")

#' Read the answer to a step
#' @param observed The space of the observations.
#' @param n The number of sub-environments that step, `NULL` for a single environment.
#' @noRd
read_step <- function(instance, observed, answer, n, name_observation, infos) {
  result <- answer$tensors %||% list(
    reward = read_values(as.numeric(numbers_from_json(answer$reward)), "Its `reward`"),
    terminated = unlist(answer$terminated), truncated = unlist(answer$truncated)
  )
  check_results(result, n %||% 1L)
  step <- list(
    observation = read_observation(observed, answer, name_observation), reward = result$reward,
    done = result$terminated | result$truncated, info = read_info(answer, n),
    terminated = result$terminated, truncated = result$truncated
  )
  if (is.null(n)) {
    return(step)
  }
  step$next_observation <- step$observation
  # The last observations of the sub-environments whose episode ended in the step.
  ended <- unlist(answer$final_sub_envs) + 1L
  if (length(ended)) {
    space <- instance$single_observation_space
    last <- read_observation(
      batch_space(space, length(ended)), answer, name_observation, "final_obs"
    )
    step$next_observation <- replace_rows(space, step$observation, n, ended, last)
    if (infos) {
      # NULL for the other sub-environments.
      step$info$final_obs <- vector("list", n)
      step$info$final_obs[ended] <- lapply(seq_along(ended), batch_value, space = space,
                                           batch = last)
    }
  }
  step
}

#' @param result A list of `reward`, `terminated` and `truncated`, with `n` elements each.
#' @noRd
check_results <- function(result, n) {
  if (!is.numeric(result$reward) || length(result$reward) != n) {
    refuse_field(result$reward, "reward", paste(n, "numbers"))
  }
  for (name in flags) {
    if (!is_flags(result[[name]], n)) {
      refuse_field(result[[name]], name, paste(n, "times true or false"))
    }
  }
}

# Observations -------------------------------------------------------------------------------

#' Read an answer's observations
#' @param name_observation A function that names them, see [naming()]; `NULL` for none.
#' @param name The answer's field, or the name of its tensors.
#' @noRd
read_observation <- function(space, answer, name_observation = NULL, name = "observation") {
  observation <- read_values(
    if (is.null(answer$tensors)) {
      decode_value(space, answer[[name]])
    } else {
      from_tensors(space, name, answer)
    },
    paste0("Its `", name, "`")
  )
  if (is.null(name_observation)) observation else name_observation(observation)
}

# The info of an answer. `n` is the number of sub-environments, `NULL` for a single environment.
read_info <- function(answer, n) {
  info <- answer$info
  if (!length(info)) {
    return(empty_object)
  }
  if (is.null(n)) info_from_json(info) else read_values(info_by_sub_env(info, n), "Its `info`")
}
