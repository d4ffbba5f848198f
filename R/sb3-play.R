# Policies that stay with Stable-Baselines3, because this package has no such networks:
# convolutional and recurrent policies, and policies that need a mask of valid actions or whose
# observations have several parts. R keeps them as data. A child process plays them and makes the
# environment in the same way as for training.

#' Make a policy of Stable-Baselines3 that is not bound to an environment
#' @param bytes A safetensors file, a raw vector: PyTorch's weights, and the moments.
#' @param about What else is needed to make the policy, a list: `algorithm`, `policy` and
#'   `arguments`.
#' @noRd
new_sb3_policy <- function(bytes, about) {
  structure(
    list(
      algorithm = about$algorithm, policy = about$policy, arguments = about$arguments,
      weights = bytes, env = NULL, kwargs = list(), observation_space = NULL, action_space = NULL
    ),
    class = c("gym_policy_sb3", "gym_policy")
  )
}

#' @export
format.gym_policy_sb3 <- function(x, ...) {
  paste0(x$policy, " of ", x$algorithm, ", by Stable-Baselines3")
}

#' @exportS3Method
policy_bind.gym_policy_sb3 <- function(policy, env, call = rlang::caller_env()) {
  made_of <- env$made_of
  if (is.null(made_of) && !is.null(policy$env)) {
    return(policy)
  }
  abort_if(
    is.null(made_of) || !is_made_by_server(made_of$env) || given_id(made_of$env)$calls_r,
    "env", made_of$env, call,
    "A policy of Stable-Baselines3 plays in a Python process, which makes the environment itself.",
    i = "Give the environment's id and its arguments, without wrappers that are R functions."
  )
  policy$env <- made_of$env
  own <- setdiff(names(made_of$arguments), c("num_envs", "num_workers", "frames"))
  policy$kwargs <- made_of$arguments[own]
  policy$action_space <- env$action_space
  policy$observation_space <- if (sees_game(policy$policy, policy$env, policy$kwargs)) {
    space_box(0, 255, c(4, 84, 84), "uint8")
  } else {
    env$observation_space
  }
  policy
}

# Does the policy see the pictures of an Atari game? These are preprocessed.
sees_game <- function(policy, env, kwargs) {
  grepl("^Cnn", policy) && grepl("^(.*:)?ALE/", env) && identical(kwargs$obs_type %||% "rgb", "rgb")
}

# The part of a job that makes the environment.
sb3_env_job <- function(algorithm, policy, env, kwargs) {
  object <- function(values) if (length(values)) values else rlang::set_names(list())
  list(
    algorithm = algorithm, env_id = given_id(env)$id, env_kwargs = object(kwargs),
    wrappers = lapply(unname(given_id(env)$wrappers), function(wrapper) {
      list(name = wrapper[[1L]], kwargs = object(wrapper[-1L]))
    }),
    atari = sees_game(policy, env, kwargs)
  )
}

#' Run a job of a policy
#' @param job What the job has besides the environment.
#' @param tensors Further files: a list of raw vectors by name.
#' @param read A function of the folder and of the job's result.
#' @noRd
run_policy_job <- function(policy, job, read, call, tensors = list(),
                           poll = function(folder) NULL) {
  folder <- temporary_file("gym-sb3-")
  dir.create(folder)
  on.exit(unlink(folder, recursive = TRUE))
  files <- c(list(policy.safetensors = policy$weights), tensors)
  for (name in names(files)) writeBin(files[[name]], file.path(folder, name))
  job <- c(job, sb3_env_job(policy$algorithm, policy$policy, policy$env, policy$kwargs))
  read(folder, run_sb3_job(job, folder, sb3_python(call), call, function() poll(folder)))
}

#' @exportS3Method
play_whole.gym_policy_sb3 <- function(policy, vector_env, episodes, max_steps, keep, report) {
  call <- vector_env$call
  frames <- !is.null(vector_env$frame)
  job <- list(
    task = "play", seeds = as.list(episodes$seed),
    max_steps = if (is.finite(max_steps)) max_steps, keep = as.list(keep), frames = frames
  )
  read <- function(folder, result) {
    error <- if (!is.null(result$error)) sb3_error(result$error, call)
    file <- file.path(folder, "episodes.safetensors")
    if (!file.exists(file)) rlang::cnd_signal(error)
    play <- list(episodes = episodes, keep = keep, vector_env = policy)
    whole <- list(first = 1L, last = length(episodes$seed))
    batch <- read_batch(play, whole, read_tensors(read_bytes(file)))
    if (frames) {
      batch$frames <- lapply(seq_along(batch$return), function(episode) {
        drawn <- list.files(file.path(folder, "frames", episode), full.names = TRUE)
        lapply(drawn, read_bytes)
      })
    }
    list(batch = batch, error = error, interrupted = result$interrupted)
  }
  poll <- function(folder) {
    played <- file.path(folder, "played")
    if (file.exists(played)) report(file.size(played))
  }
  run_policy_job(policy, job, read, call, poll = poll)
}

#' @exportS3Method
predict_policy.gym_policy_sb3 <- function(policy, newdata, type, call = rlang::caller_env()) {
  if (type == "probability") abort_no_probabilities(policy, call)
  if (type == "output") {
    abort_argument(type, "\"action\" for a policy of Stable-Baselines3", "type", call)
  }
  sb3_actions(policy, newdata, "newdata", call)
}

#' @export
act.gym_policy_sb3 <- function(policy, observation, ...) {
  sb3_actions(policy, observation, "observation", rlang::current_env())
}

sb3_actions <- function(policy, observation, arg, call) {
  check_was_played(policy, call)
  observed <- observed_batch(observation, policy$observation_space, arg, call)
  sent <- to_tensors(
    batch_space(policy$observation_space, observed$n), observed$batch, "observation", call
  )
  read <- function(folder, result) {
    if (!is.null(result$error)) rlang::cnd_signal(sb3_error(result$error, call))
    answer <- read_tensors(read_bytes(file.path(folder, "actions.safetensors")))
    from_tensors(batch_space(policy$action_space, observed$n), "action", answer)
  }
  actions <- run_policy_job(
    policy, list(task = "act", count = observed$n), read, call,
    list(observations.safetensors = write_tensors(sent, c(about = "{}")))
  )
  if (observed$one) batch_value(policy$action_space, actions, 1L) else actions
}
