#' Play whole episodes
#'
#' Play a policy in an environment for a number of episodes and return their results. If you give an
#' id, the rollout makes the environment and closes it afterwards. An environment made by
#' [gym_make()] stays open, in its last episode.
#'
#' The return of an episode is the sum of its rewards, its length the number of its steps. One whole
#' number, `seed`, determines all random numbers: the seeds of the episodes and the actions of a
#' random policy. Without `seed`, the rollout draws one from R's generator, so [set.seed()] fixes
#' everything, too. (The weights of a policy that you make in the call are drawn separately.)
#'
#' # Ways to play
#'
#' **Beside the environment**: R sends the policy to the server, whose processes play whole episodes
#' with it. This is the way if you give the environment by its id (with arguments, and wrappers of
#' [gym_wrap()]) and the policy is data: [policy_random()], [policy_network()], [policy_linear()],
#' [policy_table()], [policy_candidates()] and lists of these. An episode, including the random
#' numbers of its policy, then depends only on the environment, the policy, its seed and `max_steps`
#' (in CartPole, whose sub-environments share one seed, also on `sub_env`). The number of processes
#' and the other episodes do not matter.
#'
#' **Step by step**: R chooses the actions of each step. This is the way for everything else:
#' * functions, models and other policies that only R can run,
#' * an environment that was made before or is written in R,
#' * `frames = TRUE`, and wrappers that remember earlier episodes,
#' * episodes without a step limit, by the environment or `max_steps`,
#' * an environment with its own vector implementation, such as CartPole, if `num_envs` is not 256.
#'
#' **By Stable-Baselines3**: a policy of [learn_sb3()] that R cannot run as a network plays whole
#' episodes in a process of its own.
#'
#' Many episodes are played together, in sub-environments, except with frames. The policy gets the
#' observations of the episodes that are still running, so a function gets fewer rows at the end.
#'
#' [provenance()] says which way a result was played. `vignette("playing", package = "gym")` has
#' details, and explains how to start an episode of the result again.
#'
#' @param env The environment: an id, such as `"CartPole-v1"` (with wrappers, see [gym_wrap()]), or
#'   an environment made by [gym_make()], with or without sub-environments.
#' @param policy The policy: made by [policy_random()] or [policy_network()], or a function of many
#'   observations that returns as many actions. For the usual environments that is a function of a
#'   matrix with an observation in each row, one for each running episode, see [act()].
#'   [as_policy()] makes a policy from a fitted model. You can also give a training, which plays its
#'   policy. To play several policies together, the candidates, give a list of policies,
#'   [policy_candidates()], or trainings with several seeds.
#' @param episodes The number of episodes, for each candidate, a whole number of at least 1. The
#'   default is 1.
#' @param max_steps The number of steps after which an episode is cut off, a whole number of at
#'   least 1. Such an episode counts as truncated. `NULL`, the default, uses only the environment's
#'   own limit. If the environment has none, a policy that never fails plays forever. `max_steps`
#'   cannot raise the environment's own limit;
#'   `gym_make("MountainCar-v0", max_episode_steps = 1000)` changes that limit.
#' @param seed A whole number of at most 2^53 that fixes all random numbers, for any [RNGkind()] of
#'   the session. The session's generator does not change. `NULL`, the default, draws a seed from
#'   the session's generator.
#' @param steps Keep each step, in a table? `FALSE`, the default, or `TRUE`.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the session's client, [gym_client()].
#' @param frames Keep frames of the episodes? `FALSE`, the default, or `TRUE`, for [animate()] and
#'   [plot(type = "filmstrip")][plot.gym_rollout()]: one before the first step and one after each.
#'   Requires an environment that can be drawn, without sub-environments.
#' @param ... Arguments of the environment, by name, such as `is_slippery = FALSE` for FrozenLake,
#'   if it is given by its id.
#' @param num_envs The number of sub-environments, a whole number, if the environment is given by
#'   its id. If the server plays whole episodes, this number changes nothing except the column
#'   `sub_env`. (In CartPole it also decides how the episodes are played, see above.) `NULL`, the
#'   default, chooses, see [as_vector_env()].
#' @param next_observation Keep the observation after each step, in columns whose names begin with
#'   `next_`, such as `next_pole_angle`? `FALSE`, the default, or `TRUE`, which requires
#'   `steps = TRUE`. At the end of an episode it is the last observation of that episode.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param num_workers The number of the server's processes that run the sub-environments if R plays
#'   step by step, a whole number; 0 for the server's own process. The result does not depend on it.
#'   `NULL`, the default, lets the server choose, see [as_vector_env()]. Use it only for an
#'   environment given by its id without a vector implementation of its own (CartPole has one). If
#'   the server plays whole episodes, it always chooses itself.
#' @return An object of class `gym_rollout`, with methods for [print()], [summary()],
#'   [plot()][plot.gym_rollout()] and [as.data.frame()]. It is a list with the elements
#'   \describe{
#'     \item{episodes}{A data frame with one row for each episode: `candidate` (integer, with
#'       several policies only; each candidate's `episode` starts at 1), `episode`, `seed`,
#'       `sub_env` (integers; 1 without sub-environments), `return` (double), `length` (integer, in
#'       steps), `terminated` (logical: ended by the environment's own rules), `truncated` (logical:
#'       cut off by a step limit). Both are `TRUE` if an episode terminates at the environment's own
#'       limit.}
#'     \item{steps}{`NULL`, or with `steps = TRUE` a data frame with one row for each step:
#'       `candidate` as above, `episode`, `step` (integers), the observation before the action (in
#'       columns named as in Gymnasium's documentation, such as `pole_angle`, otherwise `obs_1`,
#'       `obs_2`, ..., with the keys of a Dict such as `obs_position_1`), `action` (or `action_1`,
#'       `action_2`, ...), `reward` (double), `terminated`, `truncated` (logical), and with
#'       `next_observation = TRUE` the observation after the step.}
#'     \item{frames}{`NULL`, or with `frames = TRUE` a list with the frames of each episode, an
#'       object of class `gym_frames`. They are kept as PNG files of a few kilobytes each.
#'       `frames[[2]][[1]]` unpacks the first frame of the second episode in the form of
#'       [env_render()] (with package png).}
#'     \item{policy}{The policy played.}
#'     \item{env_id}{The environment's id, a string.}
#'     \item{num_envs}{The number of sub-environments that share the seed of an episode, an integer;
#'       `sub_env` is one of them. `NULL` if each episode has its own seed.}
#'     \item{seed}{The seed, as given or drawn. The same call with this seed gives the same result.}
#'     \item{interrupted}{Whether it was interrupted, a logical. An interrupted rollout has the
#'       finished episodes, or, step by step, the finished batches of episodes.}
#'     \item{provenance}{The result of [provenance()].}
#'   }
#'   `as.data.frame()` returns the table of steps if there is one, otherwise that of the episodes.
#' @section Errors: `gym_error_argument` for an invalid argument (before anything is made), a policy
#'   that does not fit the environment, or a function that does not return one action for each
#'   observation. `gym_error_http` if the server refuses the environment or an action.
#'   `gym_error_connection` if it does not answer. An error during play also has the class
#'   `gym_error_rollout`. Its field `result` has the finished episodes (step by step, the finished
#'   batches of episodes).
#' @section Warnings: `gym_warning_max_steps` for a `max_steps` beyond the environment's own limit.
#' @seealso [search_random()]
#' @export
#' @examplesIf gym:::can_start_server()
#' random <- rollout("CartPole-v1", policy_random(), episodes = 20, seed = 1)
#' random
#' summary(random)
#'
#' # Any function of a matrix of observations can be a policy. Each step can be kept.
#' follow_pole <- function(observation) as.integer(observation[, "pole_angle"] > 0)
#' played <- rollout("CartPole-v1", follow_pole, episodes = 2, seed = 1, steps = TRUE)
#' head(as.data.frame(played))
#'
#' # The return from each step on, discounted by 0.99.
#' discounted <- function(reward) {
#'   Reduce(function(now, later) now + 0.99 * later, reward, accumulate = TRUE, right = TRUE)
#' }
#' head(with(played$steps, ave(reward, episode, FUN = discounted)))
#'
#' # Start the second episode again.
#' second <- played$episodes[2, ]
#' env <- gym_make("CartPole-v1", num_envs = played$num_envs)
#' env$reset(seed = second$seed)[second$sub_env, ]
#' env$close()
#'
#' # If each episode has its own seed, a single environment is enough.
#' lake <- rollout("FrozenLake-v1", policy_random(), episodes = 2, seed = 1)
#' env <- gym_make("FrozenLake-v1")
#' env$reset(seed = lake$episodes$seed[2])
#' env$close()
rollout <- function(env, policy, episodes = 1, max_steps = NULL, seed = NULL, steps = FALSE,
                    client = gym_client(), frames = FALSE, ..., num_envs = NULL,
                    next_observation = FALSE, progress = rlang::is_interactive(),
                    num_workers = NULL) {
  match_whole_names()
  check_environment(env)
  policy <- check_policies(policy)
  check_count(episodes)
  check_count(max_steps, allow_null = TRUE)
  check_seed(seed)
  if (identical(steps, "arrays")) {
    abort_defunct("`steps = TRUE` keeps the steps in a table", "`steps = \"arrays\"`")
  }
  check_flag(steps)
  check_flag(next_observation)
  if (next_observation && !steps) {
    abort_wrong("next_observation", TRUE, rlang::current_env(),
                "`next_observation = TRUE` needs the steps to be kept.", i = "Add `steps = TRUE`.")
  }
  check_flag(frames)
  check_flag(progress)
  candidates <- count_candidates(policy) %||% 1L
  # The number of all episodes must fit R's integers.
  most <- .Machine$integer.max %/% candidates
  if (episodes > most) {
    must <- paste("at most", most, "for each of", count_of(candidates, "candidate"))
    abort_argument(episodes, must, "episodes", rlang::current_env())
  }
  seed <- seed %||% draw_seed()
  limit <- max_steps %||% Inf
  play <- function(vector_env) {
    policy <- policy_bind(policy, vector_env, call = vector_env$call)
    vector_env <- env_for_policy(vector_env, policy, limit, steps)
    history <- new_history(candidates, episodes, new_streams(seed), common_seeds = TRUE)
    origin <- new_provenance(vector_env, list(seed = seed), started = NULL)
    result <- function(interrupted = FALSE) {
      new_rollout(history, policy, vector_env, origin, steps, next_observation, interrupted)
    }
    total <- candidates * episodes
    show <- progress_bar(total, "Episode", shown = progress)
    interrupted <- tryCatch(
      until_interrupted(
        play_batches(
          vector_env, history, function(candidates) policy_subset(policy, candidates),
          report = function(ended) show(history$played_episodes + ended),
          max_steps = limit, keep_steps = steps, keep_next = next_observation
        ),
        "Interrupted after {finished} of {total} episode{?s}; the finished ones are returned.",
        function() history$played_episodes, total
      ),
      error = function(cnd) {
        if (!history$played_episodes) rlang::cnd_signal(cnd)
        played <- count_of(history$played_episodes, "episode")
        abort_with_result(
          cnd, "The rollout", result(), played, "gym_error_rollout", vector_env$call
        )
      }
    )
    result(interrupted)
  }
  with_vector_env(
    env = env, episodes = candidates * episodes, play = play, max_steps = max_steps,
    num_envs = num_envs, ..., frames = frames, client = client, num_workers = num_workers,
    seed = seed
  )
}

new_rollout <- function(history, policy, vector_env, origin, steps, next_observation, interrupted) {
  several <- !is.null(count_candidates(policy))
  episodes <- episodes_table(history$batches, several)
  frames <- unlist(lapply(history$batches, `[[`, "frames"), recursive = FALSE)
  structure(class = "gym_rollout", list(
    episodes = episodes,
    steps = if (steps && nrow(episodes)) {
      steps_table(history$batches, episodes, vector_env, several, next_observation)
    },
    frames = if (!is.null(vector_env$frame)) {
      lapply(frames, new_frames, fps = vector_env$spec$render_fps)
    },
    policy = policy, env_id = environment_label(vector_env),
    num_envs = if (vector_env$one_seed) vector_env$num_envs, seed = origin$seed,
    interrupted = interrupted, provenance = origin
  ))
}

#' @export
as.data.frame.gym_rollout <- function(x, row.names = NULL, optional = FALSE, ...) {
  x$steps %||% x$episodes
}

#' @rdname rollout
#' @param object The result of `rollout()`.
#' @param newdata,type As for [predict()][predict.gym_policy()] of a policy.
#' @export
predict.gym_rollout <- function(object, newdata, type = c("action", "output"), ...) {
  type <- check_choice(type[1L], c("action", "output"), arg = "type")
  predict_policy(object$policy, newdata, type)
}

# Printing and summarising ---------------------------------------------------------

#' @export
print.gym_rollout <- function(x, ...) {
  returns <- x$episodes$return
  cat(played_lines(x, length(returns), sum(x$episodes$length)), sep = "\n")
  if (!is.null(x$episodes$candidate)) {
    print_candidates(evaluate_episodes(x$episodes, x$policy))
  } else if (length(returns) < 2L) {
    cat("Return: ", if (length(returns)) number_text(returns) else "none", "\n", sep = "")
  } else {
    cat("Return: mean ", number_text(mean(returns)), se_text(standard_error(returns)),
        ", median ", number_text(stats::median(returns)), ", from ", number_text(min(returns)),
        " to ", number_text(max(returns)), "\n", sep = "")
  }
  invisible(x)
}

#' Summarise a rollout
#'
#' Count the episodes and steps of a rollout, and summarise their returns and lengths.
#' @param object The result of [rollout()].
#' @param ... Not used.
#' @return An object of class `summary.gym_rollout`, a list with the elements `env_id` (a string),
#'   `wrappers` (their names), `policy`, `episodes` and `steps` (their numbers, integers), `returns`
#'   and `lengths` (the quartiles and the mean, named numeric vectors of length 6), `mean` and `se`
#'   (the mean return and its standard error, doubles; `se` is `NA` for a single episode),
#'   `terminated` and `truncated` (the numbers of episodes, integers), `candidates` (`NULL`, or for
#'   several policies a row for each, as in [evaluate_policy()]).
#' @export
#' @examplesIf gym:::can_start_server()
#' summary(rollout("CartPole-v1", policy_random(), episodes = 20, seed = 1))
summary.gym_rollout <- function(object, ...) {
  episodes <- object$episodes
  structure(class = "summary.gym_rollout", list(
    env_id = object$env_id, wrappers = object$provenance$wrappers, policy = object$policy,
    episodes = nrow(episodes), steps = sum(episodes$length),
    returns = quartiles(episodes$return), lengths = quartiles(episodes$length),
    mean = mean(episodes$return), se = standard_error(episodes$return),
    terminated = sum(episodes$terminated), truncated = sum(episodes$truncated),
    candidates = if (!is.null(episodes$candidate)) evaluate_episodes(episodes, object$policy)
  ))
}

#' @export
print.summary.gym_rollout <- function(x, ...) {
  cat(
    played_lines(x, x$episodes, x$steps),
    if (is.null(x$candidates)) paste0("Mean return: ", number_text(x$mean), se_text(x$se)),
    paste0("Terminated: ", x$terminated, ", truncated: ", x$truncated), "", sep = "\n"
  )
  if (is.null(x$candidates)) {
    print(signif(rbind(return = x$returns, length = x$lengths), 4L))
  } else {
    print_candidates(x$candidates)
  }
  invisible(x)
}

# Lines that say what was played, and by which policy.
played_lines <- function(x, episodes, steps, what = "Rollout") {
  c(paste0(what, " in ", env_text(x), ": ", count_of(episodes, "episode"), ", ",
           count_of(steps, "step")),
    paste0("Policy: ", policy_text(x$policy)))
}

quartiles <- function(x) {
  five <- stats::quantile(x, names = FALSE)
  c(Min. = five[[1L]], `1st Qu.` = five[[2L]], Median = five[[3L]], Mean = mean(x),
    `3rd Qu.` = five[[4L]], Max. = five[[5L]])
}

# NA for a single episode.
standard_error <- function(x) stats::sd(x) / sqrt(length(x))
