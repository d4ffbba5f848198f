# Checks of what an environment that a user has written in R returns. It must keep to the same rules
# as the server's environments, which the server checks.

flags <- c("terminated", "truncated")

is_server_env <- function(env) inherits(env, "gym_server_env")

# Nobody wants the infos of what is played: they are not asked for where a server would send them.
begin_all <- function(env, seeds) {
  if (is_server_env(env)) reset_bare(env, seeds) else narrow_values(env$reset(seed = seeds))
}

#' Take a step, and check what it returns where a user has written the environment
#' @param n How many sub-environments step.
#' @param which The numbers of these, `NULL` for all.
#' @param finals Whether `next_observation` is wanted.
#' @noRd
take_step <- function(env, n, action, which = NULL, finals = TRUE) {
  if (is_server_env(env)) {
    return(step_bare(env, action, which, finals))
  }
  out <- if (is.null(which)) env$step(action) else env$step(action, which = which)
  if (!inherits(env, "gym_r_env")) {
    out <- plain_step(out)
    where <- "`step()` of this environment"
    check_step_parts(out, n, where, NULL, needed = c("observation", "reward", flags))
  }
  out
}

# What a step returned, with plain numbers where it has an integer64. Each step is looked at, so
# what has no class is left at once.
plain_step <- function(out) {
  if (is.list(out)) {
    for (name in c("observation", "next_observation")) {
      value <- out[[name]]
      if (is.object(value) || is.list(value)) out[name] <- list(narrow_values(value))
    }
    if (is_integer64(out$reward)) out$reward <- plain_numbers(out$reward, "reward", NULL)
  }
  out
}

check_observation <- function(task, observation, where, call) {
  space <- task$observation_space
  if (length(observation) && is.atomic(observation) && is.null(dim(observation))) {
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

# Checks -------------------------------------------------------------------------------

#' Check all of what a step returned but the observation
#' @param n For how many sub-environments.
#' @param where Who returned it and when, in words.
#' @noRd
check_step_parts <- function(out, n, where, call,
                             needed = c("observation", "reward", "terminated")) {
  check_step_names(out, where, call, needed)
  must_be <- function(right, name, must) {
    if (!right) {
      problem <- paste0("The element `", name, "` of what ", where, " returned must be ", must,
                        ", not ", describe_argument(out[[name]]))
      abort_step(problem, out, call)
    }
  }
  must_be(is_reward(out$reward, n), "reward", if (n == 1L) "a number" else paste(n, "numbers"))
  flag <- paste0("TRUE or FALSE", if (n != 1L) paste(" for each of", n, "sub-environments"))
  must_be(is_flags(out$terminated, n), "terminated", flag)
  lacks <- is.null(out$truncated) && !"truncated" %in% needed
  must_be(lacks || is_flags(out$truncated, n), "truncated", flag)
  must_be(is.null(out$info) || is.list(out$info), "info", "a list")
}

check_step_names <- function(out, where, call, needed) {
  if (!is.list(out)) {
    abort_step(paste0(where, " must return a list, not ", describe_argument(out)), out, call)
  }
  absent <- setdiff(needed, names(out))
  if (length(absent)) {
    has <- if (length(names(out))) paste0("; it has `", paste(names(out), collapse = "`, `"), "`")
    abort_step(paste0("What ", where, " returned lacks `", absent[[1L]], "`", has), out, call)
  }
}

is_reward <- function(x, n) (is.numeric(x) || is.logical(x)) && length(x) == n && !anyNA(x)

is_flags <- function(x, n) is.logical(x) && length(x) == n && !anyNA(x)

abort_step <- function(problem, out, call) {
  gym_abort(
    c(
      paste0(problem, "."),
      i = paste("It must be a list of `observation`, `reward`, `terminated` (the episode ended by",
                "the environment's own rules) and `truncated` (it was cut off, such as by a limit",
                "of steps).")
    ),
    class = "gym_error_argument", argument = "env", value = out, call = call
  )
}
