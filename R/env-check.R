#' Find what is wrong with an environment
#'
#' Looks at the spaces, plays a few episodes with random actions and looks at everything that
#' comes back, as Gymnasium's `check_env()` does: observations that are not in their space, rewards
#' that are no finite number, flags that are not `TRUE` or `FALSE`, seeds that do not give the same
#' episode again, numbers drawn from the session's random generator, episodes that never end,
#' pictures that cannot be drawn, copies of an environment written in R that move each other because
#' all of them step the same other environment. It goes on after the first problem wherever it can.
#'
#' Two episodes are played, with the seeds `seed` and `seed + 1`, and the first of them once more
#' with the same actions, which must give the same again, bit for bit. All sub-environments of a
#' vector environment are looked at together, until the first of them ends.
#'
#' Where nothing is wrong with an environment made by `gym_env(model = )`, its model is compared
#' with some 1000 further steps: where play starts, where it leads, for which reward, and whether
#' the episode ends there must be possible by the model, and what is likely by the model must be
#' seen.
#'
#' @param env The environment: one that was made by [gym_env()], a class that inherits from
#'   [GymEnv], or [gym_make()]; any list or environment with functions `reset(seed)` and
#'   `step(action)`; or an id such as `"CartPole-v1"`, perhaps with wrappers (see [gym_wrap()]).
#'   It is reset and stepped; one that is named by its id is made, and closed.
#' @param ... The environment's own arguments, by name, where it is named by its id.
#' @param max_steps After how many steps an episode counts as one that never ends, a whole number,
#'   1000 by default. An environment's own limit of steps is awaited, if it is higher.
#' @param seed The first seed, a whole number from 0 to 2^53.
#' @param client The client of the server where an environment of Gymnasium's is made.
#' @return An object of class `gym_check`, which prints what was found: a data frame with a row for
#'   each finding, none for an environment in which nothing was found, and the columns
#'   \describe{
#'     \item{topic}{What was looked at, a string: `"spaces"`, `"reset"`, `"step"`, `"seeds"`,
#'       `"end"`, `"render"`, `"copies"` or `"model"`.}
#'     \item{severity}{`"wrong"` for what is a mistake, `"note"` for what may be meant.}
#'     \item{finding}{What was found, a sentence.}
#'   }
#' @section Errors: `gym_error_argument` for something that is no environment; those of
#'   [gym_make()] where one is made. What is wrong with the environment is no error.
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
  check_count(max_steps)
  check_seed(seed, min = 0)
  id <- env
  if (is.character(env) || inherits(env, "gym_wrapped")) {
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
    check$definition <- definition_of(env)
    check$copy <- copier_of(env, id, list(...))
    # It must be reset before it is played again.
    sub_env <- sub_env_of(env)
    on.exit(sub_env$taken <- NA_integer_, add = TRUE)
  }
  keep_random_state({
    look_at_environment(check, seed)
    look_at_model(env, check, seed + 1)
  })
  new_check(check)
}

# A function that makes another sub-environment, as those that play side by side are made; `NULL`
# for an object of a class, of which there is one.
copier_of <- function(env, id, arguments) {
  definition <- definition_of(env)
  if (!is.null(definition)) {
    num_envs <- sub_env_of(env)$num_envs
    function() definition_sub_env(definition, num_envs)
  } else if (is_registered(id)) {
    function() sub_env_of(make_registered(id, arguments))
  }
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
