# The result of a search, class gym_search: a training that keeps its episodes.

# What a search has beside what every training has.
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

#' Use what a search has found
#'
#' A search returns an object of class `gym_search`, a training that R's usual functions know:
#' `print()` says in a few lines what came of it, `as.data.frame()` gives its episodes,
#' `predict()` what the policy that was found does, and `summary()` plays that policy in
#' fresh episodes to estimate how good it is. `print()`, `predict()` and [plot()][plot.gym_search()]
#' never touch R's generator.
#'
#' The best of many rounds of a few episodes has also been lucky, so its mean return in the
#' search is too high an estimate. `summary()` therefore plays it again. Gym's own definition of
#' solved is a mean return of at least the environment's threshold over 100 consecutive episodes.
#'
#' @param x,object A search, as [search_random()] returns it.
#' @param row.names,optional,... Not used.
#' @param episodes How many fresh episodes to play, a whole number of at least 1; the
#'   default is 100.
#' @param seed A whole number that fixes the fresh episodes and leaves the session's
#'   generator as it was, or `NULL`, the default, to draw from the session's generator.
#' @return `as.data.frame()`: a data frame with one row for each episode of the search, in
#'   their order: `round`, `episode`, `seed`, `sub_env` (integers),
#'   `return` (double), `length` (integer, in steps), `terminated`, `truncated` (logical).
#'
#'   `predict()`: as that of the [policy][predict.gym_policy()].
#'
#'   `summary()`: an object of class `summary.gym_search`, a list with the elements `search`
#'   (the search), `rounds`, `episodes`, `steps` (how many the search used, integers),
#'   `fresh` (the [rollout()] of the policy found), `mean` and `se` (its mean return and the
#'   standard error, doubles) and `reached` (logical: has the mean of the fresh episodes
#'   reached the target?).
#' @section Errors: `gym_error_argument` when the search has no policy because it was ended
#'   in its first round, or `newdata` does not fit the policy. `summary()` needs the
#'   environment: of one given to the search as an object, it has to be open still, and the
#'   errors are those of [rollout()].
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

best_round_line <- function(x) {
  if (!nrow(x$rounds)) {
    return("Ended before the first round was played to its end")
  }
  paste0("Best of ", count_of(nrow(x$rounds), "round"), ": round ", x$round, ", mean return ",
         number_text(x$rounds$mean_return[[x$round]]), " in ",
         count_of(nrow(x$episodes) / nrow(x$rounds), "episode"))
}

check_found <- function(object, call = rlang::caller_env()) {
  if (is.null(object$policy)) {
    gym_abort(
      "The search has no policy: it ended before the first round was played to its end.",
      class = "gym_error_argument", argument = "object", value = object, call = call
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
