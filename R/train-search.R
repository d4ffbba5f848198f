# The result of a search, class gym_search: a training that keeps its episodes.

# The elements of a search that other trainings do not have.
search_parts <- function(settings, state, history) {
  episodes <- do.call(rbind, c(list(episodes_table(list(), several = TRUE)), state$episodes))
  names(episodes)[[1L]] <- "round"
  list(
    round = if (nrow(history)) state$agent$best else NA_integer_,
    rounds = data.frame(
      round = history$iteration, mean_return = history$mean_return,
      steps = as.integer(diff(c(0, history$steps)))
    ),
    episodes = episodes, template = settings$policy, max_rounds = settings$iterations,
    num_envs = settings$num_envs, client = settings$client
  )
}

#' Use the result of a search
#'
#' A search is an object of class `gym_search`, a training with methods for R's usual functions.
#' `print()` summarises it in a few lines, `as.data.frame()` returns its episodes, `predict()`
#' returns the actions of its best policy, and `summary()` plays that policy in new episodes to
#' estimate its mean return. `print()`, `predict()` and [plot()][plot.gym_search()] never use R's
#' random number generator.
#'
#' The best of many rounds of a few episodes was also lucky, so its mean return in the search is an
#' overestimate. That is why `summary()` plays the policy again. By Gym's own definition, an
#' environment is solved by a mean return of at least its threshold over 100 consecutive episodes.
#'
#' @param x,object A search, as returned by [search_random()].
#' @param row.names,optional,... Not used.
#' @param episodes The number of new episodes, a whole number of at least 1. The default is 100.
#' @param seed A whole number that fixes the new episodes and leaves the session's generator as it
#'   was. `NULL`, the default, draws a seed from the session's generator.
#' @return `as.data.frame()`: a data frame with one row for each episode of the search, in order:
#'   `round`, `episode`, `seed`, `sub_env` (integers), `return` (double), `length` (integer, in
#'   steps), `terminated`, `truncated` (logical).
#'
#'   `predict()`: the same as for the [policy][predict.gym_policy()].
#'
#'   `summary()`: an object of class `summary.gym_search`, a list with the elements `search` (the
#'   search), `rounds`, `episodes`, `steps` (their numbers in the search, integers), `fresh` (the
#'   [rollout()] of the policy), `mean` and `se` (its mean return and the standard error, doubles)
#'   and `reached` (logical: has the mean of the new episodes reached the target?).
#' @section Errors: `gym_error_argument` if the search has no policy because it was stopped in its
#'   first round, or if `newdata` does not fit the policy. `summary()` needs the environment: if the
#'   search got it as an object, it must still be open. Its errors are those of [rollout()].
#' @references The definition of solved: the text of CartPole-v0 in Gym ("average reward of
#'   195.0 over 100 consecutive trials"), and `reward_threshold` in Gymnasium's registry.
#' @name gym_search
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", rounds = 20, seed = 1)
#' search
#' head(as.data.frame(search))
#' predict(search, c(0.01, -0.2, 0.03, 0.4))
#' predict(search, c(0.01, -0.2, 0.03, 0.4), type = "output")
#' summary(search, episodes = 10, seed = 1)
NULL

#' @rdname gym_search
#' @export
as.data.frame.gym_search <- function(x, row.names = NULL, optional = FALSE, ...) {
  x$episodes
}

check_found <- function(object, call = rlang::caller_env()) {
  if (is.null(object$policy)) {
    abort_wrong(
      "object", object, call,
      "The search has no policy: it ended before the first round was played to its end."
    )
  }
}

# Summarising --------------------------------------------------------------------

#' @rdname gym_search
#' @export
summary.gym_search <- function(object, episodes = 100, seed = NULL, ...) {
  check_found(object)
  check_count(episodes)
  check_seed(seed)
  fresh <- naming_own_call(rollout(
    object$env %||% object$env_id, object$policy, episodes = episodes,
    max_steps = object$max_steps, seed = seed, client = object$client
  ), "rollout")
  returns <- fresh$episodes$return
  structure(
    list(
      search = object,
      rounds = nrow(object$rounds),
      episodes = nrow(object$episodes),
      steps = sum(object$rounds$steps),
      fresh = fresh,
      mean = mean(returns),
      se = standard_error(returns),
      reached = reaches(mean(returns), object$target)
    ),
    class = "summary.gym_search"
  )
}

#' @export
print.summary.gym_search <- function(x, ...) {
  cat(training_lines(x$search), sep = "\n")
  fresh <- nrow(x$fresh$episodes)
  verdict <- if (!is.null(x$search$target)) {
    paste0(", target ", number_text(x$search$target), if (x$reached) " reached" else " not reached")
  }
  cat(
    "",
    paste0("The policy found, in ", count_of(fresh, "fresh episode"), ":"),
    paste0("mean return ", number_text(x$mean), se_text(x$se), verdict),
    sep = "\n"
  )
  invisible(x)
}
