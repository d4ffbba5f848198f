# Checks of what the functions of an environment written in R return. It must keep to the same rules
# as the server's environments, which the server checks.

check_observation <- function(task, observation, where, call) {
  space <- task$observation_space
  if (is.atomic(observation) && is.null(dim(observation))) {
    # As the batch that it makes alone, which is checked more quickly.
    alone <- observation
    dim(alone) <- if (length(space$shape) == 1L) c(1L, length(alone))
    if (task$fits_observations(alone, 1L)) {
      return(invisible())
    }
  }
  tryCatch(
    check_value(space, observation, "", NULL, bounds = TRUE),
    gym_error_space = function(cnd) refuse_observation(cnd, space, where, call)
  )
}

#' Check the observations of several sub-environments
#' @param which The numbers of these sub-environments.
#' @noRd
check_observations <- function(task, observations, which, where, call) {
  n <- length(which)
  if (!task$fits_observations(observations, n)) {
    space <- task$observation_space
    tryCatch(
      check_batch(space, batch_space(space, n), observations, n, NULL, which, bounds = TRUE),
      gym_error_space = function(cnd) refuse_observation(cnd, space, where, call)
    )
  }
}

refuse_observation <- function(cnd, space, where, call) {
  gym_abort(
    c(
      paste0(where, " returned an observation that is not in its space ", format(space), "."),
      x = cnd$message,
      x = cnd$body[["x"]],
      i = "Change what it returns, or the environment's `observation_space`."
    ),
    class = "gym_error_space", space = space, value = cnd$value, path = cnd$path,
    sub_env = cnd$sub_env, call = call
  )
}

#' Check what a step returned, and complete it
#'
#' @param out What the user's `step()` returned.
#' @param sub_env The sub-environment, which has counted the step.
#' @return A list of `observation`, `reward`, `terminated`, `truncated`, which also says where the
#'   limit of steps was reached, and `info`.
#' @noRd
complete_step <- function(out, sub_env, sub_env_number = NULL, call = rlang::caller_env()) {
  task <- sub_env$task
  where <- step_place(sub_env, sub_env_number)
  check_step_parts(out, sub_env$num_envs %||% 1L, where, call)
  observation <- if (is.null(sub_env$num_envs)) {
    check_observation(task, out$observation, where, call)
    tidy_value(task$observation_space, out$observation)
  } else {
    check_observations(task, out$observation, seq_len(sub_env$num_envs), where, call)
    tidy_batch(task$observation_space, out$observation)
  }
  truncated <- out$truncated %||% logical(sub_env$num_envs %||% 1L)
  list(
    observation = observation,
    reward = as.numeric(out$reward),
    terminated = out$terminated,
    truncated = truncated | sub_env$taken >= task$limit,
    info = out$info %||% list()
  )
}

# Who returned what is wrong, and when.
step_place <- function(sub_env, sub_env_number = NULL) {
  in_sub_env <- if (!is.null(sub_env_number)) paste0(" (sub-environment ", sub_env_number, ")")
  paste0("`step()` of ", sub_env$task$spec$id, " in step ", sub_env$taken, " of the episode",
         in_sub_env)
}

# Everything but the observation.
check_step_parts <- function(out, n, where, call) {
  check_step_names(out, where, call)
  must_be <- function(name, one, each) {
    wanted <- if (n == 1L) one else paste(each, n, "sub-environments")
    problem <- paste0(where, " returned a `", name, "` that is ", describe_argument(out[[name]]),
                      ", and not ", wanted)
    abort_step(problem, out, call)
  }
  if (!is_reward(out$reward, n)) {
    must_be("reward", "one number", "a number for each of")
  }
  if (!is_flags(out$terminated, n)) {
    must_be("terminated", "TRUE or FALSE", "TRUE or FALSE for each of")
  }
  if (!is.null(out$truncated) && !is_flags(out$truncated, n)) {
    must_be("truncated", "TRUE or FALSE", "TRUE or FALSE for each of")
  }
  if (!is.null(out$info) && !is.list(out$info)) {
    must_be("info", "a list", "a list for")
  }
}

check_step_names <- function(out, where, call) {
  if (!is.list(out)) {
    abort_step(paste0(where, " returned ", describe_argument(out), ", which is no list"), out, call)
  }
  absent <- setdiff(c("observation", "reward", "terminated"), names(out))
  if (length(absent)) {
    has <- if (length(names(out))) paste0("; it has `", paste(names(out), collapse = "`, `"), "`")
    problem <- paste0(where, " returned a list without `", absent[[1L]], "`", has)
    abort_step(problem, out, call)
  }
}

is_reward <- function(x, n) (is.numeric(x) || is.logical(x)) && length(x) == n && !anyNA(x)

is_flags <- function(x, n) is.logical(x) && length(x) == n && !anyNA(x)

abort_step <- function(problem, out, call) {
  gym_abort(
    c(
      paste0(problem, "."),
      i = paste("It must return a list of `observation`, `reward`, `terminated` (the episode ended",
                "by the environment's own rules) and perhaps `truncated` (it was cut off) and",
                "`info` (a list).")
    ),
    class = "gym_error_argument", argument = "env", value = out, call = call
  )
}
