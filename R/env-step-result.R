# Checks the results of a user's environment by the same rules as the server uses for its
# environments.

flags <- c("terminated", "truncated")

is_server_env <- function(env) inherits(env, "gym_server_env")

# Playing needs no infos, so this does not ask a server for them. Only a server's environment takes
# a list of seeds.
first_observation <- function(env, seed, ...) {
  if (is_server_env(env)) {
    if (is.list(seed)) class(seed) <- "gym_seed_lists"
    env$reset(seed = seed, ..., infos = FALSE)
  } else {
    plain_numbers(env$reset(seed = seed, ...), "observation", NULL)
  }
}

#' Take a step, and check the result of a user's environment
#' @param n The number of sub-environments that step.
#' @param which Their numbers, `NULL` for all.
#' @param finals Whether `next_observation` is needed.
#' @noRd
take_step <- function(env, n, action, which = NULL, finals = TRUE) {
  if (is_server_env(env)) {
    return(env$step(action, which, infos = FALSE, finals = finals))
  }
  out <- if (is.null(which)) env$step(action) else env$step(action, which = which)
  if (!inherits(env, "gym_r_env")) {
    plain_numbers(out, "step()", NULL)
    where <- "`step()` of this environment"
    check_step_parts(out, n, where, NULL, needed = c("observation", "reward", flags))
  }
  out
}

#' Check the result of a step and complete it
#'
#' Every step of an environment written in R is checked here. [check_env()] uses the same rules.
#' @param out The result of the user's `step()`.
#' @param sub_env The sub-environment. It has already counted the step.
#' @return A list of `observation`, `reward`, `terminated`, `truncated`, which includes the step
#'   limit, and `info`.
#' @noRd
complete_step <- function(out, sub_env, sub_env_number = NULL, call = rlang::caller_env(),
                          where = step_place(sub_env, sub_env_number)) {
  traits <- sub_env$traits
  out <- check_step_parts(out, sub_env$num_envs %||% 1L, where, call)
  list(
    observation = checked_observation(traits, out$observation, sub_env$num_envs, where, call),
    reward = as.numeric(out$reward),
    terminated = out$terminated,
    truncated = out$truncated | sub_env$taken >= traits$limit,
    info = out$info %||% list()
  )
}

# Says where a wrong result came from. It is a default argument, so this costs time only after a
# mistake.
step_place <- function(sub_env, sub_env_number = NULL) {
  in_sub_env <- if (!is.null(sub_env_number)) paste0(" (sub-environment ", sub_env_number, ")")
  paste0("`step()` of ", sub_env$traits$spec$id, " in step ", sub_env$taken, " of the episode",
         in_sub_env)
}

# Observations -------------------------------------------------------------------------

#' Check an observation returned by an environment in R, or a batch of them
#'
#' @param n The number of sub-environments in the batch; `NULL` for a single observation.
#' @param where Who returned it and when, in words.
#' @return The observation, in the form of a server's.
#' @noRd
checked_observation <- function(traits, observation, n, where, call) {
  space <- traits$observation_space
  if (!fits_quickly(space, observation, n, traits$fits_observations)) {
    tryCatch(
      check_one_or_batch(traits$observation_rules, observation, n, NULL),
      gym_error_space = function(cnd) refuse_observation(cnd, space, where, call)
    )
  }
  check_order_of_names(space, observation, n, where, call)
  tidy_value(space, observation, n)
}

# The numbers of an observation must be in the order of the space. The same names in another order
# are a mistake. Other names are ignored: they may come from the vectors that the user computed
# with.
check_order_of_names <- function(space, observation, n, where, call) {
  given <- if (is.null(n) || is.list(observation)) names(observation) else colnames(observation)
  if (!is.null(given) && !is.null(space$names) && !identical(given, space$names) &&
        setequal(given, space$names)) {
    gym_abort(
      c(paste0(where, " returned an observation with names in another order than those of its ",
               "space: ", few_names(given), "."),
        i = paste0("Its order is ", few_names(space$names), ".")),
      class = "gym_error_space", space = space, value = observation, path = "", call = call
    )
  }
}

# A quick check whether a value, or a batch of `n`, fits. `fits` checks batches, so a single value
# becomes a batch of one.
fits_quickly <- function(space, value, n, fits) {
  if (is.null(n)) {
    if (!length(value) || !is.atomic(value) || !is.null(dim(value))) {
      return(FALSE)
    }
    n <- 1L
    if (length(space$shape) == 1L) dim(value) <- c(n, length(value))
  }
  fits(value, n)
}

# Checks a value or, if there is an `n`, a batch for the sub-environments `which`.
check_one_or_batch <- function(space, value, n, call, which = seq_len(n)) {
  if (is.null(n)) {
    check_value(space, value, "", call, bounds = TRUE)
  } else {
    check_batch(space, batch_space(space, n), value, n, call, which, bounds = TRUE)
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
    class = "gym_error_space", argument = "env", space = space, value = cnd$value,
    path = cnd$path, sub_env = cnd$sub_env, call = call
  )
}

# The other parts ------------------------------------------------------------------------

#' Check the elements of a step's result, except the observation
#' @param n The number of sub-environments.
#' @param where Who returned it and when, in words.
#' @return The result. If `truncated` is optional and missing, it becomes FALSE.
#' @noRd
check_step_parts <- function(out, n, where, call,
                             needed = c("observation", "reward", "terminated")) {
  if (!is.list(out)) {
    abort_step(paste0(where, " must return a list, not ", describe_argument(out)), out, call)
  }
  absent <- setdiff(needed, names(out))
  if (length(absent)) {
    has <- if (length(names(out))) paste0("; it has `", paste(names(out), collapse = "`, `"), "`")
    abort_step(paste0("The result of ", where, " lacks `", absent[[1L]], "`", has), out, call)
  }
  if (!"truncated" %in% needed) out$truncated <- out$truncated %||% logical(n)
  wrong <- wrong_parts(out, n)
  if (length(wrong)) {
    name <- names(wrong)[[1L]]
    problem <- paste0("The element `", name, "` of the result of ", where, " must be ",
                      wrong[[1L]], ", not ", describe_argument(out[[name]]))
    abort_step(problem, out, call)
  }
  out
}

#' Find the wrong elements of a step's result
#' @param finite Whether infinite rewards count as wrong.
#' @return What each wrong element must be, a character vector named by the elements; `NULL` if all
#'   are right.
#' @noRd
wrong_parts <- function(out, n, finite = FALSE) {
  reward <- out$reward
  right <- c(
    reward = (is.numeric(reward) || is.logical(reward)) && !is_integer64(reward) &&
      length(reward) == n && !anyNA(reward) &&
      (!finite || is.numeric(reward) && all(is.finite(reward))),
    terminated = is_flags(out$terminated, n),
    truncated = is_flags(out$truncated, n),
    info = is.null(out$info) || is.list(out$info)
  )
  if (all(right)) {
    return(NULL)
  }
  each <- if (n != 1L) paste(" for each of", n, "sub-environments")
  flag <- paste0("TRUE or FALSE", each)
  must <- c(
    reward = paste0(if (finite) "one finite number" else "a number", each), terminated = flag,
    truncated = flag, info = "a list"
  )
  must[!right]
}

is_flags <- function(x, n) is.logical(x) && length(x) == n && !anyNA(x)

abort_step <- function(problem, out, call) {
  abort_wrong(
    "env", out, call, "{problem}.",
    i = "It must be a list of `observation`, `reward`, `terminated` (the episode ended by the
         environment's own rules) and `truncated` (it was cut off, such as by a limit of steps)."
  )
}

# Steps after the end --------------------------------------------------------------------

warn_step_after_end <- function(what, call) {
  rlang::warn(
    c(
      paste(what, "took a step after the end of its episode."),
      i = "The result is undefined: reset the environment first."
    ),
    class = "gym_warning_step_after_done",
    call = call
  )
}
