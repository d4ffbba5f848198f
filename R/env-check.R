#' Check an environment
#'
#' Check the spaces, play a few episodes with random actions and check all results, like Gymnasium's
#' `check_env()`. It finds observations outside their space, rewards that are not finite numbers,
#' flags that are not `TRUE` or `FALSE`, seeds that do not reproduce an episode, random numbers from
#' the session's generator, episodes that never end, and frames that cannot be drawn. If possible,
#' it continues after a problem.
#'
#' It plays two episodes, with the seeds `seed` and `seed + 1`. It then repeats the first one with
#' the same actions, which must give the same results, bit for bit. All sub-environments of a vector
#' environment are checked together, until the first of them ends.
#'
#' If an environment made by `gym_env(model = )` has no other problem, its model is compared with
#' some 1000 further steps. The starting states, next states, rewards and ends must be possible by
#' the model.
#'
#' @param env The environment: made by [gym_env()] or [gym_make()]; any list or environment with
#'   functions `reset(seed)` and `step(action)`; or an id such as `"CartPole-v1"` (with wrappers,
#'   see [gym_wrap()]). The check resets and steps it. An environment given by its id is made and
#'   closed.
#' @param ... Arguments of the environment, by name, if it is given by its id.
#' @param max_steps The number of steps after which an episode counts as endless, a whole number,
#'   1000 by default. A higher limit of the environment itself replaces it.
#' @param seed The first seed, a whole number from 0 to 2^53.
#' @param client The client of the server that makes an environment of Gymnasium.
#' @return An object of class `gym_check`, which prints the findings: a data frame with a row for
#'   each finding, without rows if there are none, and the columns
#'   \describe{
#'     \item{topic}{The topic, a string: `"spaces"`, `"reset"`, `"step"`, `"seeds"`, `"end"`,
#'       `"render"` or `"model"`.}
#'     \item{severity}{`"wrong"` for a mistake, `"note"` for something that may be intended.}
#'     \item{finding}{The finding, a sentence.}
#'   }
#' @section Errors: `gym_error_argument` for an object that is not an environment. As for
#'   [gym_make()] if an environment is made. Problems of the environment are findings, not errors.
#' @seealso [gym_env()], `vignette("own-environment")`
#' @export
#' @examples
#' # A walk along 5 places, with two mistakes.
#' walk <- list(
#'   observation_space = space_discrete(5), action_space = space_discrete(2),
#'   spec = list(id = "Walk"),
#'   reset = function(seed = NULL) place <<- 0,
#'   step = function(action) {
#'     place <<- place + if (action == 1) 1 else -1
#'     list(observation = place, reward = NA, terminated = place == 4, truncated = FALSE)
#'   }
#' )
#' check_env(walk)
check_env <- function(env, ..., max_steps = 1000, seed = 1, client = gym_client()) {
  match_whole_names()
  check_count(max_steps)
  check_seed(seed, min = 0)
  if (is_given_by_id(env)) {
    check_environment(env)
    env <- gym_make(env, ..., seed = seed, client = client)
    on.exit(close_quietly(env))
  } else if (is.list(env) || is.environment(env)) {
    check_made_before(NULL, list(...), env)
  } else {
    check_environment(env)
  }
  check <- rlang::env(
    env = env, found = list(), misfits = 0L, lengths = integer(), limit = max_steps,
    in_r = inherits(env, "gym_r_env")
  )
  if (check$in_r) {
    check$env <- without_checks(env)
    # Reset it before it is played again.
    sub_env <- sub_env_of(env)
    on.exit(sub_env$taken <- NA_integer_, add = TRUE)
  }
  keep_random_state({
    look_at_environment(check, seed)
    look_at_model(env, check, seed + 1)
  })
  new_check(check)
}

new_check <- function(check) {
  column <- function(name) as.character(vapply(check$found, `[[`, "", name))
  spec <- check$env[["spec"]]
  structure(
    data.frame(
      topic = column("topic"), severity = column("severity"), finding = column("finding")
    ),
    label = environment_label(list(spec = if (is.list(spec)) spec)), lengths = check$lengths,
    class = c("gym_check", "data.frame")
  )
}

#' @export
format.gym_check <- function(x, ...) paste0("<gym_check: ", attr(x, "label"), ">")

#' @export
print.gym_check <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  lengths <- attr(x, "lengths")
  if (length(lengths)) {
    range <- unique(range(lengths))
    cat("  played: ", count_of(length(lengths), "episode"), " of ", paste(range, collapse = " to "),
        " step", if (!identical(range, 1L)) "s", "\n", sep = "")
  }
  for (row in order(x$severity != "wrong")) {
    cat(sitrep_mark(x$severity[[row]]), " ", x$topic[[row]], ": ", x$finding[[row]], "\n", sep = "")
  }
  if (!any(x$severity == "wrong")) {
    cat(sitrep_mark("ok"), " Nothing is wrong.\n", sep = "")
  }
  invisible(x)
}
