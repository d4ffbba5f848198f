# The instances of environments on a server, as a client knows them.

create_instance <- function(client, env_id, seed, render_mode, kwargs, wrappers, num_envs = NULL,
                            vectorization_mode = NULL, autoreset_mode = NULL, name = NULL,
                            num_workers = NULL, call = rlang::caller_env()) {
  check_wrappers(wrappers, call = call)
  if (inherits(env_id, "gym_wrapped")) {
    wrappers <- c(env_id$wrappers, wrappers)
    env_id <- env_id$env_id
  }
  check_string(env_id, call = call)
  check_string(render_mode, allow_null = TRUE, call = call)
  check_count(num_envs, allow_null = TRUE, call = call)
  check_vector_mode(vectorization_mode, vectorization_modes, num_envs, call = call)
  check_vector_mode(autoreset_mode, autoreset_modes, num_envs, call = call)
  check_num_workers(num_workers, num_envs, call = call)
  check_string(name, allow_null = TRUE, call = call)
  fields <- c(
    env_id = json_string(env_id),
    num_envs = if (!is.null(num_envs)) whole_text(num_envs),
    num_workers = if (!is.null(num_workers)) whole_text(num_workers),
    vectorization_mode = if (!is.null(vectorization_mode)) json_string(vectorization_mode),
    autoreset_mode = if (!is.null(autoreset_mode)) json_string(autoreset_mode),
    seed = encode_seed(seed, num_envs, call),
    render_mode = if (!is.null(render_mode)) json_string(render_mode),
    kwargs = if (length(kwargs)) to_json(kwargs),
    wrappers = if (length(wrappers)) wrappers_json(wrappers),
    name = if (!is.null(name)) json_string(name)
  )
  if (identical(render_mode, "human")) {
    check_viewer(call)
  }
  close_queued(client)
  instance_id <- create_on_server(client, fields, call)
  if (isTRUE(client_state(client)$classic)) {
    withCallingHandlers(
      check_classic_fields(client, fields, c("env_id", "seed"), call),
      gym_error = function(cnd) close_if_there(client, instance_id, call)
    )
  }
  instance_id
}

close_instance <- function(client, instance_id, call = rlang::caller_env()) {
  post_once(client, paste0(instance_route(instance_id), "close/"), call = call)
  forget_instance(instance_place(client, instance_id))
  instances <- client_state(client)$instances
  if (!is.null(instances[[instance_id]])) {
    rm(list = instance_id, envir = instances)
  }
}

# Closes an instance that may be gone already.
close_if_there <- function(client, instance_id, call = rlang::caller_env()) {
  tryCatch(
    close_instance(client, instance_id, call),
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% gone_codes)) rlang::cnd_signal(cnd)
      forget_instance(instance_place(client, instance_id))
    }
  )
}

# The codes of errors that say that an instance is gone, whether it was closed or evicted.
gone_codes <- c("unknown_instance", "instance_idle_closed", "call_too_long", "environment_died")

# What the client knows of an instance. The server is asked once.
known_instance <- function(client, instance_id, call = rlang::caller_env()) {
  check_client(client, "x", call)
  check_string(instance_id, call = call)
  instances <- client_state(client)$instances
  instances[[instance_id]] %||%
    (instances[[instance_id]] <- ask_instance(client, instance_id, call))
}

ask_instance <- function(client, instance_id, call) {
  route <- instance_route(instance_id)
  answer <- tryCatch(
    get_answer(client, route, call = call),
    gym_error_http_404 = function(cnd) classic_description(client, instance_id, cnd, call)
  )
  check_about(answer)
  instance <- new.env(parent = emptyenv())
  instance$classic <- isTRUE(answer$classic)
  space_of <- if (instance$classic) new_classic_space else new_space
  instance$id <- instance_id
  instance$route <- route
  instance$reset_route <- paste0(route, "reset/")
  instance$step_route <- paste0(route, "step/")
  instance$num_envs <- answer$num_envs
  instance$num_workers <- answer$num_workers
  instance$vectorization_mode <- shown_line(answer$vectorization_mode)
  instance$autoreset_mode <- shown_line(answer$autoreset_mode)
  instance$single_action_space <- read_values(space_of(answer$action_space), "Its `action_space`")
  instance$single_observation_space <- read_values(
    space_of(answer$observation_space), "Its `observation_space`"
  )
  instance$single_observation_space$names <- observation_names(
    answer$env_id, instance$single_observation_space, answered_wrapper_names(answer$wrappers)
  )
  instance$name_observation <- naming(
    instance$single_observation_space, batch = !is.null(answer$num_envs)
  )
  instance$actions <- sent_space(instance$single_action_space, answer$num_envs)
  instance$observations <- sent_space(instance$single_observation_space, answer$num_envs)
  as_tensors <- function(space) !instance$classic && travels_as_tensors(space, answer$num_envs)
  instance$takes_tensors <- as_tensors(instance$single_observation_space)
  instance$sends_tensors <- as_tensors(instance$single_action_space)
  instance$spec <- list(
    id = shown_line(answer$env_id),
    reward_threshold = if (!is.null(answer$reward_threshold)) {
      number_from(answer$reward_threshold, "reward_threshold")
    },
    max_episode_steps = answer$max_episode_steps,
    # The environment's own metadata may be anything.
    render_fps = if (is_number(answer$render_fps)) answer$render_fps
  )
  instance$draws <- !is.null(answer$render_mode)
  instance$done <- FALSE
  instance
}

# The names of the wrappers in an answer, which classic servers do not send.
answered_wrapper_names <- function(wrappers) {
  as.character(unlist(lapply(wrappers, function(wrapper) wrapper["name"])))
}

# The space of all sub-environments together is made only when it is asked for: the bounds of
# thousands of pictures take much memory.
instance_space <- function(instance, which = c("action_space", "observation_space")) {
  if (is.null(instance$num_envs)) {
    return(instance[[paste0("single_", which)]])
  }
  instance[[which]] %||% (
    instance[[which]] <- spread_bounds(
      switch(which, action_space = instance$actions, observation_space = instance$observations)
    )
  )
}

#' Start an episode
#' @param named Whether observations are to carry their names: those of the classic calls do not.
#' @noRd
reset_instance <- function(client, instance, seed, options, return_info = FALSE, mask = NULL,
                           named = FALSE, call = rlang::caller_env()) {
  check_mask(mask, instance, call)
  close_queued(client)
  fields <- c(
    seed = encode_seed(seed, instance$num_envs, call),
    options = encode_options(options, call),
    reset_mask = if (!is.null(mask)) to_json(I(mask))
  )
  if (instance$classic) {
    check_classic_fields(client, fields, NULL, call)
  }
  answer <- post_once(
    client, instance$reset_route, fields, take_tensors = instance$takes_tensors, call = call
  )
  instance$done <- FALSE
  check_answer_info(answer)
  observation <- decode_observation(instance$observations, answer)
  if (named) observation <- with_names(instance, observation)
  if (return_info) {
    list(observation = observation, info = info_from(instance, answer))
  } else {
    observation
  }
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

info_from <- function(instance, answer) {
  if (is.null(instance$num_envs)) {
    info_from_json(answer$info %||% empty_object)
  } else {
    info_by_sub_env(answer$info, instance$num_envs)
  }
}

step_instance <- function(client, instance, action, render, which = NULL, named = FALSE,
                          call = rlang::caller_env()) {
  fields <- c(render = if (render) "true" else "false")
  if (!is.null(which) || !is.null(instance$num_envs)) {
    return(step_vector_env(client, instance, action, fields, which, named, call))
  }
  space <- instance$actions
  # A classic server's error does not say that an action was wrong, so bounds are checked here.
  bounds <- instance$classic && inherits(space, "gym_space_discrete")
  check_value(space, action, "", call, bounds)
  answer <- send_action(client, instance, space, action, write_value(space, action), fields, call)
  if (!is.null(answer$tensors)) {
    answer[c("reward", "terminated", "truncated")] <-
      answer$tensors[c("reward", "terminated", "truncated")]
    check_answer_results(answer, 1L)
    answer$done <- answer$terminated || answer$truncated
  } else if (instance$classic) {
    answer <- classic_flags(answer)
  }
  check_answer_flags(answer)
  check_answer_info(answer)
  if (isTRUE(instance$done)) {
    warn_step_after_done(instance, call)
  } else if (isFALSE(instance$done)) {
    instance$done <- answer$done
  }
  observation <- decode_observation(instance$observations, answer)
  list(
    observation = if (named) with_names(instance, observation) else observation,
    reward = number_from(answer$reward, "reward"),
    done = answer$done,
    info = info_from_json(answer$info),
    terminated = answer$terminated,
    truncated = answer$truncated
  )
}

# `json` is the action as JSON, a promise that is evaluated only if the action is sent so.
send_action <- function(client, instance, space, action, json, fields, call) {
  route <- instance$step_route
  if (!instance$sends_tensors) {
    fields <- c(action = json, fields)
    return(post_once(client, route, fields, take_tensors = instance$takes_tensors, call = call))
  }
  tensors <- to_tensors(space, action, "action", call)
  texts <- vapply(tensors, is.character, NA)
  if (any(texts)) {
    fields <- c(fields, texts = to_json(tensors[texts]))
    tensors <- tensors[!texts]
  }
  post_once(client, route, fields, tensors = tensors, take_tensors = TRUE, call = call)
}

warn_step_after_done <- function(instance, call) {
  # NA: the episode is over, and the warning has been given.
  instance$done <- NA
  rlang::warn(
    c(
      paste0("Instance ", instance$id, " of ", instance$spec$id,
             " took a step after the end of its episode."),
      i = "What comes of it is undefined: reset the environment first."
    ),
    class = "gym_warning_step_after_done",
    call = call
  )
}

# One seed for all, or in a vector environment one for each sub-environment, NA for none; or a list
# with several for a sub-environment, the later ones for the episodes that it begins by itself.
encode_seed <- function(seed, num_envs = NULL, call = rlang::caller_env()) {
  if (is.null(seed)) {
    return(NULL)
  }
  if (!is.list(seed) && (is.null(num_envs) || length(seed) == 1L)) {
    check_count(seed, min = 0, max = 2^53, call = call)
    return(whole_text(seed))
  }
  check_sub_env_seeds(seed, num_envs, call)
  if (is.list(seed)) {
    json_array(vapply(seed, encode_sub_env_seeds, ""))
  } else {
    json_array(ifelse(is.na(seed), "null", whole_text(seed)))
  }
}

encode_sub_env_seeds <- function(seeds) {
  if (anyNA(seeds)) "null" else json_array(whole_text(seeds))
}

encode_options <- function(options, call) {
  if (!is.null(options)) {
    check_named_list(options, call = call)
    to_json(options)
  }
}
