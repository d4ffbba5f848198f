# Vector environments: how their sub-environments are picked by number or by mask, how they are
# stepped, and what is checked of both.

vectorization_modes <- c("vector_entry_point", "sync", "async")
autoreset_modes <- c("NextStep", "SameStep", "Disabled")

# The space of what is sent and received: for a vector environment that of a batch.
sent_space <- function(space, num_envs) {
  if (is.null(num_envs)) space else batch_space(space, num_envs)
}

# Whether values are sent as tensors. Those of a vector environment always are where that is
# possible; but a safetensors file needs at least one number.
travels_as_tensors <- function(space, num_envs) {
  if (is.null(num_envs)) {
    tensors_pay(space)
  } else {
    has_tensors(space) && count_numbers(space) > 0
  }
}

# Steps ---------------------------------------------------------------------------------

step_vector_env <- function(client, instance, action, fields, which, named, call) {
  check_which(which, instance, call)
  n <- instance$num_envs
  actions <- instance$actions
  observations <- instance$observations
  if (length(which) && length(which) < n) {
    mask <- seq_len(n) %in% which
    fields <- c(fields, step_mask = to_json(I(mask)))
    n <- length(which)
    actions <- batch_space(instance$single_action_space, n)
    observations <- batch_space(instance$single_observation_space, n)
  }
  single <- instance$single_action_space
  check_batch(single, actions, action, n, call, which)
  answer <- send_action(
    client, instance, actions, action, write_batch(single, action, n), fields, call
  )
  result <- read_values(results_by_sub_env(answer), "Its `reward`")
  check_answer_results(result, n)
  check_answer_info(answer)
  info <- read_values(info_by_sub_env(answer$info, n), "Its `info`")
  observation <- decode_observation(observations, answer)
  if (named) observation <- with_names(instance, observation)
  next_observation <- observation
  if (length(answer$final_sub_envs)) {
    final <- final_observations(instance, answer, n, named)
    info$final_obs <- final_by_sub_env(instance$single_observation_space, final, n)
    next_observation <- replace_rows(
      instance$single_observation_space, observation, n, final$sub_envs, final$values
    )
  }
  list(
    observation = observation,
    reward = result$reward,
    done = result$terminated | result$truncated,
    info = info,
    terminated = result$terminated,
    truncated = result$truncated,
    next_observation = next_observation
  )
}

results_by_sub_env <- function(answer) {
  answer$tensors %||% list(
    reward = as.numeric(numbers_from_json(answer$reward)),
    terminated = unlist(answer$terminated),
    truncated = unlist(answer$truncated)
  )
}

# The last observations of the sub-environments that ended within the step: the numbers of these
# sub-environments from 1, and a batch of the observations.
final_observations <- function(instance, answer, n, named) {
  ended <- unlist(answer$final_sub_envs)
  check_final_sub_envs(ended, n)
  batch <- batch_space(instance$single_observation_space, length(ended))
  values <- decode_observation(batch, answer, "final_obs")
  list(sub_envs = ended + 1L, values = if (named) with_names(instance, values) else values)
}

# A list: the last observation of each sub-environment that ended, NULL for the others.
final_by_sub_env <- function(space, final, n) {
  each <- vector("list", n)
  each[final$sub_envs] <- lapply(seq_along(final$sub_envs), function(i) {
    batch_value(space, final$values, i)
  })
  each
}

# The server draws an action for each sub-environment.
decode_sample <- function(instance, json) {
  single <- instance$single_action_space
  if (is.null(instance$num_envs)) {
    decode_value(single, json)
  } else {
    check_list(json, instance$num_envs, "all sub-environments")
    batch_of(single, lapply(json, decode_value, space = single))
  }
}

# Checks --------------------------------------------------------------------------------

check_vector_mode <- function(x, choices, num_envs, arg = rlang::caller_arg(x), call) {
  if (is.null(x)) {
    return(invisible())
  }
  check_choice(x, choices, arg, call)
  check_has_sub_envs(num_envs, x, arg, call)
}

check_num_workers <- function(num_workers, num_envs, call) {
  check_count(num_workers, min = 0, allow_null = TRUE, call = call)
  if (!is.null(num_workers)) {
    check_has_sub_envs(num_envs, num_workers, "num_workers", call)
  }
}

check_has_sub_envs <- function(num_envs, x, arg, call) {
  if (is.null(num_envs)) {
    gym_abort(
      c(
        paste0("`", arg, "` is for an environment with sub-environments."),
        i = "Say how many with `num_envs`."
      ),
      class = "gym_error_argument", argument = arg, value = x, call = call
    )
  }
}

check_sub_env_seeds <- function(seed, num_envs, call) {
  are_seeds <- function(x) is.numeric(x) && are_whole(x[!is.na(x) | is.nan(x)], 0, 2^53)
  right <- if (is.list(seed)) {
    all(lengths(seed) > 0L) && are_seeds(unlist(seed, recursive = FALSE))
  } else {
    are_seeds(seed)
  }
  if (!right || length(seed) != num_envs) {
    must <- paste0(
      "a whole number of at least 0, or ", num_envs,
      " of them, one for each sub-environment (NA for none)"
    )
    abort_argument(seed, must, "seed", call)
  }
}

check_mask <- function(mask, instance, call) {
  if (is.null(mask)) {
    return(invisible())
  }
  check_is_vector_env(instance, mask, "mask", call)
  n <- instance$num_envs
  if (!is.logical(mask) || length(mask) != n || anyNA(mask) || !any(mask)) {
    must <- paste0(
      "a logical vector of length ", n, ", one for each sub-environment, with a TRUE in it"
    )
    abort_argument(mask, must, "mask", call)
  }
}

check_which <- function(which, instance, call) {
  if (is.null(which)) {
    return(invisible())
  }
  check_is_vector_env(instance, which, "which", call)
  n <- instance$num_envs
  if (!are_whole(which, 1, n) || length(which) == 0L || is.unsorted(which, strictly = TRUE)) {
    must <- paste0("numbers of sub-environments from 1 to ", n, ", in increasing order")
    abort_argument(which, must, "which", call)
  }
}

check_is_vector_env <- function(instance, x, arg, call) {
  if (is.null(instance$num_envs)) {
    gym_abort(
      c(
        paste0("`", arg, "` is for an environment with sub-environments; this ", instance$spec$id,
               " has none."),
        i = "`gym_make()` makes one with `num_envs`."
      ),
      class = "gym_error_argument", argument = arg, value = x, call = call
    )
  }
}
