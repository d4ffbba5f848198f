# The result of a search, whatever its method: class gym_search.

#' Make the result of a search
#'
#' @param state What was played, as [new_training()] makes it. Rounds that have finished count.
#' @noRd
search_result <- function(settings, state, interrupted = FALSE) {
  agent <- state$agent
  episodes <- rounds_episodes(state$episodes)
  rounds <- rounds_table(episodes, settings$episodes)
  found <- agent$played > 0L
  structure(
    list(
      policy = if (found) agent_policy(agent),
      solved = found && reaches(agent$best_return, settings$target),
      round = if (found) agent$best else NA_integer_,
      rounds = rounds,
      episodes = episodes,
      history = rounds_history(rounds, settings$episodes),
      agent = agent,
      target = settings$target,
      env_id = settings$env_id,
      env = settings[["env"]],
      num_envs = settings$num_envs,
      client = settings$client,
      template = settings$policy,
      max_rounds = settings$rounds,
      max_steps = settings$max_steps,
      seed = settings$seed,
      steps = sum(as.numeric(rounds$steps)),
      elapsed = proc.time()[["elapsed"]] - state$started,
      interrupted = interrupted,
      provenance = settings$provenance
    ),
    class = c("gym_search", "gym_training")
  )
}

# The episodes of all iterations; their rounds count on from one iteration to the next.
rounds_episodes <- function(iterations) {
  before <- 0L
  for (i in seq_along(iterations)) {
    iterations[[i]]$candidate <- iterations[[i]]$candidate + before
    before <- max(iterations[[i]]$candidate)
  }
  episodes <- do.call(rbind, c(list(episodes_table(list(), several = TRUE)), iterations))
  names(episodes)[[1L]] <- "round"
  episodes
}

rounds_table <- function(episodes, each) {
  rounds <- nrow(episodes) %/% each
  of_rounds <- function(values) matrix(values, ncol = rounds)
  data.frame(
    round = seq_len(rounds), mean_return = colMeans(of_rounds(episodes$return)),
    steps = as.integer(colSums(of_rounds(episodes$length)))
  )
}

# As that of a training: a round is an iteration with one candidate, whose time was not taken.
rounds_history <- function(rounds, each) {
  mean <- rounds$mean_return
  data.frame(
    iteration = rounds$round, steps = cumsum(as.numeric(rounds$steps)), min_return = mean,
    median_return = mean, mean_return = mean, max_return = mean,
    mean_length = rounds$steps / each, evaluation = rep(NA_real_, length(mean)),
    elapsed = rep(NA_real_, length(mean))
  )
}

#' Use what a search has found
#'
#' A search returns an object of class `gym_search`, which R's usual functions know:
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
#' @param newdata,type As for [predict()][predict.gym_policy()] of a policy.
#' @param episodes How many fresh episodes to play, a whole number of at least 1; the
#'   default is 100.
#' @param seed A whole number that fixes the fresh episodes and leaves the session's
#'   generator as it was, or `NULL`, the default, to draw from the session's generator.
#' @return `as.data.frame()`: a data frame with one row for each episode of the search, in
#'   their order: `round`, `episode`, `seed`, `sub_env` (integers),
#'   `return` (double), `length` (integer, in steps), `terminated`, `truncated` (logical).
#'
#'   `predict()`: for `n` observations the actions, an integer vector of length `n` (a
#'   matrix with `n` rows where an action has several numbers), or the outputs, a numeric
#'   vector of length `n` (a matrix with `n` rows where the network has several).
#'
#'   `summary()`: an object of class `summary.gym_search`, a list with the elements `search`
#'   (the search), `rounds`, `episodes`, `steps` (how many the search used, integers),
#'   `fresh` (the [rollout()] of the policy found), `mean` and `se` (its mean return and the
#'   standard error, doubles) and `solved` (logical: has the mean of the fresh episodes
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

#' @export
print.gym_search <- function(x, ...) {
  cat(search_lines(x), sep = "\n")
  invisible(x)
}

search_lines <- function(x) {
  c(
    paste("Random search in", x$env_id),
    paste0("Policy: ", policy_text(x$template)),
    "",
    outcome_line(x),
    effort_line(x)
  )
}

outcome_line <- function(x) {
  if (is.null(x$policy)) {
    return("Ended before the first round was played to its end")
  }
  mean <- number_text(x$rounds$mean_return[[x$round]])
  target <- if (!is.null(x$target)) paste0(" (target ", number_text(x$target), ")")
  if (x$solved) {
    paste0("Solved in round ", x$round, " of at most ", x$max_rounds, ": mean return ", mean,
           target)
  } else {
    paste0(if (!is.null(x$target)) "Not solved. ", "Best of ", count_of(nrow(x$rounds), "round"),
           ": round ", x$round, ", mean return ", mean, target)
  }
}

effort_line <- function(x) {
  paste0(
    if (x$interrupted) "Interrupted after " else "Played ",
    count_of(nrow(x$rounds), "round"), ", ", count_of(nrow(x$episodes), "episode"), ", ",
    count_of(sum(x$rounds$steps), "step"), " in ", seconds_text(x$elapsed)
  )
}

# Predicting -------------------------------------------------------------------

#' @rdname gym_search
#' @export
predict.gym_search <- function(object, newdata, type = c("action", "output"), ...) {
  type <- check_choice(type[1L], c("action", "output"), arg = "type")
  check_found(object)
  predict_policy(object$policy, newdata, type)
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
      solved = reaches(mean(returns), object$target)
    ),
    class = "summary.gym_search"
  )
}

#' @export
print.summary.gym_search <- function(x, ...) {
  cat(search_lines(x$search), sep = "\n")
  fresh <- nrow(x$fresh$episodes)
  verdict <- if (!is.null(x$search$target)) {
    paste0(", target ", number_text(x$search$target), if (x$solved) " reached" else " not reached")
  }
  cat(
    "",
    paste0("The policy found, in ", count_of(fresh, "fresh episode"), ":"),
    paste0("mean return ", number_text(x$mean), se_text(x$se), verdict),
    sep = "\n"
  )
  invisible(x)
}
