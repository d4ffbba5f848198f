#' Evaluate policies
#'
#' Play each policy for the same number of episodes, and compute its mean return with a confidence
#' interval. To get the results of single episodes, use [rollout()].
#'
#' All policies play the same episodes, so none has easier ones by luck. The exception: if R steps
#' sub-environments that share a seed (see [as_vector_env()]), their episodes differ.
#'
#' @inheritParams rollout
#' @param policy As for [rollout()]: one policy, a list of several, or [policy_candidates()].
#' @param episodes The number of episodes for each policy, a whole number of at least 1. The default
#'   is 100.
#' @param level The confidence level of the interval, a number between 0 and 1. The default is 0.95.
#' @return A data frame of class `gym_evaluation` with one row for each policy. `candidate` is its
#'   number (integer), `mean_return` the mean return of its episodes, `se` the standard error of
#'   this mean, `lower` and `upper` the bounds of the confidence interval (doubles, `NA` for a
#'   single episode), `episodes` and `steps` the numbers of episodes and steps played (integers).
#'   Rows have the names of policies in a list, or of rows of weights.
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
    evaluate_episodes(played$episodes, played$policy, level), level = level, env_id = played$env_id,
    policy = played$policy, seed = played$seed, provenance = played$provenance,
    class = c("gym_evaluation", "data.frame")
  )
}

#' Evaluate each candidate by its episodes
#' @param episodes A table of episodes, with a column `candidate` if there are several policies.
#' @return A data frame, see [evaluate_policy()].
#' @noRd
evaluate_episodes <- function(episodes, policy, level = 0.95) {
  candidate <- episodes$candidate %||% rep(1L, nrow(episodes))
  each <- split(episodes, candidate)
  column <- function(f, type) unname(vapply(each, f, type))
  mean_return <- column(function(own) mean(own$return), 0)
  se <- column(function(own) standard_error(own$return), 0)
  count <- column(nrow, 0L)
  # A single episode has no interval: `se` is NA. pmax() avoids a warning of qt().
  beyond <- se * stats::qt((1 + level) / 2, pmax(count - 1L, 1L))
  numbers <- as.integer(names(each))
  data.frame(
    candidate = numbers, mean_return = mean_return, se = se, lower = mean_return - beyond,
    upper = mean_return + beyond, episodes = count,
    steps = column(function(own) sum(own$length), 0L), row.names = candidate_names(policy)[numbers]
  )
}

#' @export
print.gym_evaluation <- function(x, ...) {
  if (!all(evaluation_columns %in% names(x)) || is.null(attr(x, "env_id"))) {
    # The user has selected columns.
    return(invisible(NextMethod()))
  }
  cat(played_lines(attributes(x), sum(x$episodes), sum(x$steps), "Evaluation"), sep = "\n")
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

# Prints a row for each candidate. If there are many, only those with the highest mean returns.
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

#' The return of a policy as a function of its weights
#'
#' Make a function for optimisers such as [stats::optim()], which minimise. The function plays the
#' policy with a vector of weights, and returns minus the mean return. It plays the same episodes
#' each time, so equal weights have equal values.
#'
#' @inheritParams evaluate_policy
#' @param policy The policy whose weights are the function's argument: a network, by default
#'   [policy_linear()]. If it normalises observations, their means and variances stay as they are.
#' @param episodes The number of episodes that a mean return is computed from, a whole number of at
#'   least 1. The default is 10.
#' @param seed A whole number that fixes the episodes. `NULL`, the default, draws one when you make
#'   the function.
#' @return A function of class `gym_objective`. Its argument `weights` is a numeric vector in the
#'   order of [coef()][coef.gym_policy_network], or a matrix with the weights of a candidate in each
#'   row; candidates are played together. It returns minus the mean return of each candidate, a
#'   numeric vector. Its attribute `policy` is the policy, bound to the environment:
#'   `coef(attr(f, "policy"))` gives weights to start with.
#' @section Errors: As for [rollout()]. The function raises a `gym_error_argument` for a wrong
#'   number of weights.
#' @seealso [train_agent()], [evaluate_policy()]
#' @export
#' @examplesIf gym:::can_start_server()
#' objective <- gym_objective("CartPole-v1", episodes = 5, seed = 1)
#' objective(c(0, 0, 1, 1))
#' objective(rbind(left = c(0, 0, -1, 0), right = c(0, 0, 1, 1)))
#'
#' set.seed(1)
#' start <- coef(attr(objective, "policy"))
#' found <- optim(start, objective, method = "SANN", control = list(maxit = 20))
#' found$value
#' policy <- attr(objective, "policy")
#' coef(policy) <- found$par
gym_objective <- function(env, policy = policy_linear(), episodes = 10, seed = NULL, ...,
                          max_steps = NULL, num_envs = NULL, client = gym_client(),
                          num_workers = NULL) {
  match_whole_names()
  call <- rlang::current_env()
  check_environment(env)
  check_count(episodes)
  check_seed(seed)
  if (!inherits(policy, "gym_policy_network")) {
    abort_no_weights(policy, "policy", call)
  }
  seed <- seed %||% draw_seed()
  in_env <- function(episodes, play) {
    with_vector_env(env = env, episodes = episodes, play = play, max_steps = max_steps, ...,
                    num_envs = num_envs, num_workers = num_workers, client = client, seed = seed,
                    call = call)
  }
  policy <- in_env(1, function(vector_env) policy_bind(policy, vector_env, call = call))
  played <- same_episodes(seed, as.integer(episodes), max_steps)
  objective <- function(weights) {
    candidates <- naming_own_call(
      policy_candidates(policy, if (is.matrix(weights)) weights else rbind(weights)),
      "policy_candidates"
    )
    count <- nrow(candidates$weights)
    -in_env(count * episodes, function(vector_env) played(vector_env, candidates, count))
  }
  structure(objective, policy = policy, class = c("gym_objective", "function"))
}

# Returns a function that plays the same episodes with each candidate and returns the mean returns.
# That function must not draw random numbers: each draw in R would reset the generator that
# optim(method = "SANN") uses in C.
same_episodes <- function(seed, episodes, max_steps) {
  streams <- new_streams(seed)
  seeds <- with_generator(streams$seeds, draw_environment_seeds(episodes))
  kept <- saved_streams(streams)
  play <- function(vector_env, candidates, which) {
    history <- new_history(length(which), episodes, restore_streams(kept), common_seeds = TRUE)
    taken <- 0L
    history$draw_seeds <- function(n) {
      taken <<- taken + n
      seeds[taken - n + seq_len(n)]
    }
    play_batches(
      vector_env, history, function(these) policy_subset(candidates, which[these]),
      max_steps = max_steps %||% Inf
    )
    colMeans(matrix(episode_results(history)$returns, episodes))
  }
  function(vector_env, candidates, count) {
    # If R steps sub-environments that share a seed, candidates that play together would get
    # different episodes.
    playing <- env_for_policy(vector_env, candidates, max_steps %||% Inf)
    if (!playing$one_seed || !is.null(playing$description)) {
      play(playing, candidates, seq_len(count))
    } else {
      vapply(seq_len(count), function(one) play(playing, candidates, one), 0)
    }
  }
}

#' @export
print.gym_objective <- function(x, ...) {
  policy <- attr(x, "policy")
  print_lines(x, paste0("<objective: minus the mean return of ", format(policy), " in ",
                        env_text(policy), ">"))
}
