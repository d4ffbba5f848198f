#' Evaluate policies
#'
#' Play each policy in the same number of episodes and return its mean return with a confidence
#' interval. The single episodes are not kept; use [rollout()] to get them.
#'
#' All candidates play the same episodes, so none is favoured by luck. The exception is R stepping
#' sub-environments that share a seed (see [as_vector_env()]).
#'
#' @inheritParams rollout
#' @param policy As for [rollout()]: one policy, a list of several, or [policy_candidates()].
#' @param episodes The number of episodes for each policy, a whole number of at least 1. The default
#'   is 100.
#' @param level The confidence level of the interval, a number between 0 and 1. The default is 0.95.
#' @return A data frame of class `gym_evaluation` with one row for each policy. `candidate` is its
#'   number (integer), `mean_return` the mean return of its episodes, `se` the standard error of
#'   this mean, `lower` and `upper` the bounds of the confidence interval (doubles, `NA` for a
#'   single episode), `episodes` and `steps` the numbers played (integers). Rows have the names of
#'   policies in a list, or of rows of weights.
#' @section Errors: As for [rollout()].
#' @references The interval is that of [stats::t.test()].
#' @seealso [plot()][plot.gym_evaluation()] for a picture; [rollout()], whose
#'   [plot()][plot.gym_rollout()] shows all returns.
#' @export
#' @examplesIf gym:::can_start_server()
#' follow_pole <- function(observation) as.integer(observation[, 3] > 0)
#' evaluate_policy("CartPole-v1", follow_pole, episodes = 50, seed = 1)
#'
#' policies <- list(random = policy_random(), follow = follow_pole)
#' compared <- evaluate_policy("CartPole-v1", policies, episodes = 50, seed = 1)
#' compared
#' compared["follow", "mean_return"]
#'
#' # The best of a hundred networks.
#' weights <- matrix(runif(100 * 10, -1, 1), nrow = 100)
#' candidates <- policy_candidates(policy_network(c(4, 2, 1)), weights)
#' evaluation <- evaluate_policy("CartPole-v1", candidates, episodes = 5, seed = 1)
#' evaluation
#' best <- policy_network(c(4, 2, 1))
#' coef(best) <- weights[which.max(evaluation$mean_return), ]
evaluate_policy <- function(env, policy, ...) UseMethod("evaluate_policy")

#' @rdname evaluate_policy
#' @export
evaluate_policy.default <- function(env, policy, episodes = 100, seed = NULL, ...,
                                    max_steps = NULL, num_envs = NULL, level = 0.95,
                                    progress = rlang::is_interactive(), client = gym_client(),
                                    num_workers = NULL) {
  match_whole_names()
  check_level(level)
  played <- naming_own_call(rollout(
    env, policy, episodes, max_steps = max_steps, seed = seed, ..., num_envs = num_envs,
    progress = progress, client = client, num_workers = num_workers
  ), "rollout")
  structure(
    evaluate_episodes(played$episodes, played$policy, level), level = level,
    env_id = played$env_id, policy = played$policy, seed = played$seed,
    provenance = played$provenance,
    class = c("gym_evaluation", "data.frame")
  )
}

#' Evaluate each candidate by its episodes
#' @param episodes A table of episodes, with a column `candidate` where there are several.
#' @return A data frame, see [evaluate_policy()].
#' @noRd
evaluate_episodes <- function(episodes, policy, level = 0.95) {
  candidate <- episodes$candidate %||% rep(1L, nrow(episodes))
  each <- split(episodes, candidate)
  column <- function(f, type) unname(vapply(each, f, type))
  mean_return <- column(function(own) mean(own$return), 0)
  se <- column(function(own) standard_error(own$return), 0)
  count <- column(nrow, 0L)
  # A single episode has no interval, and no quantile for one.
  beyond <- se * stats::qt((1 + level) / 2, pmax(count - 1L, 1L))
  numbers <- as.integer(names(each))
  data.frame(
    candidate = numbers, mean_return = mean_return, se = se, lower = mean_return - beyond,
    upper = mean_return + beyond, episodes = count,
    steps = column(function(own) sum(own$length), 0L),
    row.names = candidate_names(policy)[numbers]
  )
}

#' @export
print.gym_evaluation <- function(x, ...) {
  if (!all(evaluation_columns %in% names(x)) || is.null(attr(x, "env_id"))) {
    # The user has selected columns.
    return(invisible(NextMethod()))
  }
  cat(
    paste0("Evaluation in ", env_text(attributes(x)), ": ",
           count_of(sum(x$episodes), "episode"), ", ", count_of(sum(x$steps), "step")),
    paste0("Policy: ", policy_text(attr(x, "policy"))),
    sep = "\n"
  )
  if (nrow(x) == 1L && is.null(count_candidates(attr(x, "policy")))) {
    # A single episode has no interval.
    interval <- if (!is.na(x$se)) paste0(", ", interval_text(x$lower, x$upper, attr(x, "level")))
    cat("Mean return: ", number_text(x$mean_return), se_text(x$se), interval, "\n", sep = "")
  } else {
    print_candidates(x, attr(x, "level"))
  }
  invisible(x)
}

interval_text <- function(lower, upper, level = 0.95, text = number_text) {
  paste0(level_text(level), " interval from ", text(lower), " to ", text(upper))
}

check_level <- function(level, call = rlang::caller_env()) {
  if (!is_number(level) || level <= 0 || level >= 1) {
    abort_argument(level, "a number between 0 and 1", "level", call)
  }
}

level_text <- function(level) paste0(format(100 * level), "%")

# Prints a row for each candidate, or for the ones with the highest mean returns of many.
print_candidates <- function(x, level = 0.95, most = 10L) {
  few <- nrow(x) <= most
  shown <- if (few) seq_len(nrow(x)) else order(-x$mean_return)[seq_len(most)]
  cat(
    if (few) "Mean returns" else paste("The", most, "highest of", nrow(x), "mean returns"),
    ", with ", level_text(level), " intervals:\n", sep = ""
  )
  table <- as.list(x)[evaluation_columns]
  table$candidate <- row.names(x)
  numbers <- c("mean_return", "se", "lower", "upper")
  table[numbers] <- lapply(table[numbers], signif, digits = 4L)
  print(data.frame(lapply(table, `[`, shown)), row.names = FALSE)
}

evaluation_columns <- c("candidate", "mean_return", "se", "lower", "upper", "episodes", "steps")
