# Steps and resets. What an instance's calls have in common is bound once, in a prepared call for
# each combination of their flags, see prepare_call().

#' Start an episode
#' @param named Whether observations are to carry their names: those of the classic calls do not.
#' @param infos Whether the server is to make infos.
#' @noRd
reset_instance <- function(client, instance, seed, options, return_info = FALSE, mask = NULL,
                           named = FALSE, infos = TRUE, call = rlang::caller_env()) {
  close_queued(client)
  fields <- c(
    seed = encode_seed(seed, instance$num_envs, call),
    options = encode_options(options, call),
    reset_mask = mask_json(mask, instance, call)
  )
  if (instance$classic) {
    check_classic_fields(client, fields, NULL, call)
  }
  # A place for each combination of the flags.
  slot <- 1L + named + 2L * infos
  prepared <- instance$prepared_resets[[slot]]
  if (is.null(prepared)) {
    prepared <- prepare_reset(client, instance, named, infos)
    instance$prepared_resets[[slot]] <- prepared
  }
  result <- call_prepared(client, prepared, json_members(fields), call)
  instance$done <- FALSE
  if (return_info) result else result$observation
}

prepare_reset <- function(client, instance, named, infos) {
  read_answer <- function(answer) {
    check_answer_info(answer)
    list(
      observation = read_observation(instance, instance$observations, answer, named),
      info = info_from(instance, answer)
    )
  }
  read_quickly <- if (!is.null(instance$num_envs)) read_answer else function(answer) {
    if (is_object(answer$info)) {
      list(observation = read_quick_observation(instance, answer, named),
           info = info_from_json(answer$info))
    }
  }
  finish <- function(tensors) {
    observation <- tensors_observation(instance, instance$observations, tensors, named)
    list(observation = observation, info = empty_object)
  }
  prepare_instance_call(
    client, instance, instance$reset_route, FALSE, bare_fields(instance, infos), named,
    read_answer, read_quickly, finish
  )
}

#' Take a step
#' @inheritParams reset_instance
#' @param finals Whether the server is to send the last observations of episodes after which another
#'   one began.
#' @noRd
step_instance <- function(client, instance, action, render, which = NULL, named = FALSE,
                          infos = TRUE, finals = TRUE, call = rlang::caller_env()) {
  slot <- 1L + named + 2L * infos + 4L * render + 8L * finals
  prepared <- instance$prepared_steps[[slot]]
  if (is.null(prepared) || !identical(prepared$which, which)) {
    check_which(which, instance, call)
    prepared <- prepare_step(client, instance, render, which, named, infos, finals)
    instance$prepared_steps[[slot]] <- prepared
  }
  content <- prepared$write(action) %||% prepared$check(action, call)
  result <- call_prepared(client, prepared, content, call)
  if (is.null(instance$num_envs)) {
    if (isTRUE(instance$done)) {
      # NA: the episode is over, and the warning has been given.
      instance$done <- NA
      warn_step_after_end(paste("Instance", instance$id, "of", instance$spec$id), call)
    } else if (isFALSE(instance$done)) {
      instance$done <- result$done
    }
  }
  result
}

prepare_step <- function(client, instance, render, which, named, infos, finals) {
  fields <- c(
    render = if (render) "true" else "false", bare_fields(instance, infos),
    final_obs = if (!finals && !instance$classic) "false"
  )
  n <- instance$num_envs
  prepared <- if (is.null(n)) {
    prepare_single_step(client, instance, fields, named)
  } else {
    some <- length(which) && length(which) < n
    if (some) fields <- c(fields, step_mask = json_array(json_atoms(seq_len(n) %in% which)))
    stepping <- if (some) length(which) else n
    prepare_vector_step(client, instance, fields, stepping, which, named, infos)
  }
  prepared$which <- which
  prepared
}

# The field by which a server is told to make no infos. Classic servers do not know it.
bare_fields <- function(instance, infos) {
  if (!infos && !instance$classic) c(info = "false")
}

#' Prepare the calls of one of an instance's routes
#' @param read_quickly Does what `read_answer` does for answers as they nearly always are; it may
#'   return `NULL`, or fail. `finish` is as that of [new_tensors_reader()].
#' @noRd
prepare_instance_call <- function(client, instance, route, sends, fields, named, read_answer,
                                  read_quickly, finish) {
  read <- if (instance$takes_tensors) {
    space <- instance$single_observation_space
    labels <- if (named && inherits(space, "gym_space_box")) space$names
    new_tensors_reader(client_state(client)$layouts, read_answer, finish, labels)
  } else {
    new_json_reader(read_quickly)
  }
  takes <- instance$takes_tensors || sends
  prepared <- prepare_call(client, route, sends, takes, fields, read, read_answer)
  prepared$has_texts <- sends && has_texts(instance$single_action_space)
  prepared
}

# Steps of a single environment --------------------------------------------------------------

prepare_single_step <- function(client, instance, fields, named) {
  space <- instance$observations
  prepared <- prepare_instance_call(
    client, instance, instance$step_route, instance$sends_tensors, fields, named,
    read_answer = function(answer) read_single_step(instance, answer, named),
    read_quickly = function(answer) read_quick_step(instance, answer, named),
    finish = function(tensors) {
      observation <- tensors_observation(instance, space, tensors, named)
      step_result(observation, tensors$reward, tensors$terminated, tensors$truncated, empty_object)
    }
  )
  actions <- instance$actions
  general <- instance$sends_tensors || instance$classic
  prepared$write <- if (general) function(action) NULL else json_writer(actions)
  # A classic server's error does not say that an action was wrong, so bounds are checked here.
  bounds <- instance$classic && inherits(actions, "gym_space_discrete")
  prepared$check <- function(action, call) {
    check_value(actions, action, "", call, bounds)
    if (instance$sends_tensors) {
      to_tensors(actions, action, "action", call)
    } else {
      paste0('"action":', write_value(actions, action), ",")
    }
  }
  prepared
}

step_result <- function(observation, reward, terminated, truncated, info) {
  list(
    observation = observation, reward = reward, done = terminated | truncated, info = info,
    terminated = terminated, truncated = truncated
  )
}

# Reads an answer as it nearly always is. `NULL` for any other.
read_quick_step <- function(instance, answer, named) {
  reward <- answer$reward
  info <- answer$info
  if (is.numeric(reward) && length(reward) == 1L && are_step_flags(answer) && is_object(info)) {
    step_result(
      read_quick_observation(instance, answer, named), as.numeric(reward), answer$terminated,
      answer$truncated, if (length(info)) info_from_json(info) else info
    )
  }
}

are_step_flags <- function(answer) {
  is_flag(answer$terminated) && is_flag(answer$truncated) &&
    identical(answer$done, answer$terminated || answer$truncated)
}

read_single_step <- function(instance, answer, named) {
  if (!is.null(answer$tensors)) {
    answer[flags_and_reward] <- answer$tensors[flags_and_reward]
    check_answer_results(answer, 1L)
    answer$done <- answer$terminated || answer$truncated
  } else if (instance$classic) {
    answer <- classic_flags(answer)
  }
  check_answer_flags(answer)
  check_answer_info(answer)
  list(
    observation = read_observation(instance, instance$observations, answer, named),
    reward = number_from(answer$reward, "reward"),
    done = answer$done,
    info = info_from_json(answer$info),
    terminated = answer$terminated,
    truncated = answer$truncated
  )
}

flags_and_reward <- c("reward", "terminated", "truncated")

# Observations -------------------------------------------------------------------------------

read_observation <- function(instance, space, answer, named) {
  observation <- decode_observation(space, answer)
  if (named) with_names(instance, observation) else observation
}

decode_observation <- function(space, answer, name = "observation") {
  read_values(
    if (is.null(answer$tensors)) {
      decode_value(space, answer[[name]])
    } else {
      from_tensors(space, name, answer)
    },
    paste0("Its `", name, "`")
  )
}

with_names <- function(instance, observation) {
  name_observation <- instance$name_observation
  if (is.null(name_observation)) observation else name_observation(observation)
}

# An observation in JSON, by the reader that was made for the instance.
read_quick_observation <- function(instance, answer, named) {
  observation <- instance$read_observation(answer$observation)
  if (named) with_names(instance, observation) else observation
}

# The observation in tensors that were read by a form. An array has its names already.
tensors_observation <- function(instance, space, tensors, named) {
  # Not with `$`, which would find the only part of a Tuple or Dict, "observation/...".
  tensors[["observation"]] %||% read_observation(instance, space, list(tensors = tensors), named)
}

info_from <- function(instance, answer) {
  if (is.null(instance$num_envs)) {
    info_from_json(answer$info %||% empty_object)
  } else {
    info_by_sub_env(answer$info, instance$num_envs)
  }
}

# For rollouts -------------------------------------------------------------------------------

#' Start episodes, or take a step, without infos
#'
#' What `$reset()` and `$step()` of an environment on a server do, for those who want no infos: the
#' server then makes none.
#' @param env An environment of [gym_make()].
#' @param seeds A seed for each of `which`, or a list with a vector of seeds for each: the first for
#'   now, the others for the episodes that the sub-environment begins by itself.
#' @param which The numbers of the sub-environments, in increasing order; `NULL` for all.
#' @param finals Whether `next_observation` has the last observations of episodes after which
#'   another one began. Without them all answers have one form, which is read more quickly.
#' @return `reset_bare()` the first observations, a row for each of `which`; `step_bare()` what
#'   `$step()` returns, with an empty info.
#' @noRd
reset_bare <- function(env, seeds, which = NULL, call = rlang::caller_env()) {
  instance <- open_instance(env, call)
  n <- instance$num_envs
  some <- !is.null(n) && length(which) && length(which) < n
  if (some) {
    check_which(which, instance, call)
    all <- rep(if (is.list(seeds)) list(NULL) else NA_real_, n)
    all[which] <- seeds
    seeds <- all
  }
  mask <- if (some) seq_len(n) %in% which
  if (is.list(seeds)) {
    class(seeds) <- "gym_seed_lists"
  }
  observation <- reset_instance(
    env$client, instance, seeds, NULL, mask = mask, named = TRUE, infos = FALSE, call = call
  )
  if (some) batch_rows(instance$single_observation_space, observation, which) else observation
}

step_bare <- function(env, action, which = NULL, finals = TRUE, call = rlang::caller_env()) {
  instance <- open_instance(env, call)
  step_instance(
    env$client, instance, action, FALSE, which, named = TRUE, infos = FALSE, finals = finals,
    call = call
  )
}

open_instance <- function(env, call) {
  check_open(env, call)
  instances <- client_state(env$client)$instances
  instances[[env$instance_id]] %||% known_instance(env$client, env$instance_id, call)
}
