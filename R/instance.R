# The environments on a server, as a client knows them.

create_instance <- function(x, env_id, seed, render_mode, kwargs, wrappers,
                            call = rlang::caller_env()) {
  check_wrappers(wrappers, call = call)
  if (inherits(env_id, "gym_wrapped")) {
    wrappers <- c(env_id$wrappers, wrappers)
    env_id <- env_id$env_id
  }
  check_string(env_id, call = call)
  check_string(render_mode, allow_null = TRUE, call = call)
  fields <- c(
    env_id = json_string(env_id),
    seed = encode_seed(seed, call = call),
    render_mode = if (!is.null(render_mode)) json_string(render_mode),
    kwargs = if (length(kwargs)) to_json(kwargs),
    wrappers = if (length(wrappers)) wrappers_json(wrappers)
  )
  close_abandoned(x)
  post_once(x, "/v1/envs/", fields, call = call)$instance_id
}

instance_route <- function(instance_id) {
  paste0("/v1/envs/", curl::curl_escape(instance_id), "/")
}

close_instance <- function(x, instance_id, call = rlang::caller_env()) {
  post_once(x, paste0(instance_route(instance_id), "close/"), call = call)
  instances <- connection(x)$instances
  if (!is.null(instances[[instance_id]])) {
    rm(list = instance_id, envir = instances)
  }
}

# As close_instance(), for an instance that may be gone already.
close_if_there <- function(x, instance_id, call = rlang::caller_env()) {
  tryCatch(
    close_instance(x, instance_id, call),
    gym_error_http_400 = function(cnd) {
      if (!identical(cnd$code, "unknown_instance")) rlang::cnd_signal(cnd)
    }
  )
}

# What the client knows of an instance; asked of the server once.
known_instance <- function(x, instance_id, call = rlang::caller_env()) {
  check_client(x, call = call)
  check_string(instance_id, call = call)
  instances <- connection(x)$instances
  instances[[instance_id]] %||% (instances[[instance_id]] <- ask_instance(x, instance_id, call))
}

ask_instance <- function(x, instance_id, call) {
  route <- instance_route(instance_id)
  answer <- get_answer(x, route, call = call)
  instance <- new.env(parent = emptyenv())
  instance$id <- instance_id
  instance$route <- route
  instance$reset_route <- paste0(route, "reset/")
  instance$step_route <- paste0(route, "step/")
  instance$action_space <- new_space(answer$action_space)
  instance$observation_space <- new_space(answer$observation_space)
  instance$takes_tensors <- tensors_pay(instance$observation_space)
  instance$sends_tensors <- tensors_pay(instance$action_space)
  instance$spec <- list(
    id = answer$env_id,
    reward_threshold = answer$reward_threshold,
    max_episode_steps = answer$max_episode_steps
  )
  instance$done <- FALSE
  instance
}

reset_instance <- function(x, instance, seed, options, return_info = FALSE,
                           call = rlang::caller_env()) {
  fields <- c(seed = encode_seed(seed, call = call), options = encode_options(options, call))
  answer <- post_once(
    x, instance$reset_route, fields, take_tensors = instance$takes_tensors, call = call
  )
  instance$done <- FALSE
  observation <- observation_from(instance, answer)
  if (return_info) {
    list(observation = observation, info = info_from_json(answer$info))
  } else {
    observation
  }
}

observation_from <- function(instance, answer) {
  if (is.null(answer$tensors)) {
    decode_value(instance$observation_space, answer$observation)
  } else {
    from_tensors(instance$observation_space, "observation", answer)
  }
}

step_instance <- function(x, instance, action, render, call = rlang::caller_env()) {
  answer <- send_action(x, instance, action, if (render) "true" else "false", call)
  if (!is.null(answer$tensors)) {
    answer[c("reward", "terminated", "truncated")] <-
      answer$tensors[c("reward", "terminated", "truncated")]
    answer$done <- answer$terminated || answer$truncated
  }
  if (isTRUE(instance$done)) {
    warn_step_after_done(instance, call)
  } else {
    instance$done <- answer$done
  }
  list(
    observation = observation_from(instance, answer),
    reward = number_from_json(answer$reward),
    done = answer$done,
    info = info_from_json(answer$info),
    terminated = answer$terminated,
    truncated = answer$truncated
  )
}

send_action <- function(x, instance, action, render, call) {
  space <- instance$action_space
  route <- instance$step_route
  if (!instance$sends_tensors) {
    fields <- c(action = encode_value(space, action, call), render = render)
    return(post_once(x, route, fields, take_tensors = instance$takes_tensors, call = call))
  }
  check_value(space, action, "", call)
  parts <- to_tensors(space, action, "action", call)
  texts <- Filter(is.character, parts)
  fields <- c(render = render, texts = if (length(texts)) to_json(texts))
  tensors <- Filter(is.list, parts)
  post_once(x, route, fields, tensors = tensors, take_tensors = TRUE, call = call)
}

warn_step_after_done <- function(instance, call) {
  # NA: done, and said so.
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

encode_seed <- function(seed, call = rlang::caller_env()) {
  if (!is.null(seed)) {
    check_count(seed, min = 0, max = 2^53, call = call)
    whole_text(seed)
  }
}

encode_options <- function(options, call) {
  if (!is.null(options)) {
    check_named_list(options, call = call)
    to_json(options)
  }
}

# Environments whose objects were thrown away are closed when the next is made:
# a finalizer may run in the middle of another call and must not start its own.
close_abandoned <- function(x) {
  state <- connection(x)
  abandoned <- state$to_close
  state$to_close <- character()
  for (instance_id in abandoned) {
    close_if_there(x, instance_id)
  }
}
