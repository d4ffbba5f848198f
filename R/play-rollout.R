#' Play whole episodes
#'
#' Plays a policy in an environment for a number of episodes, and keeps what came of
#' it. An environment named by its id is made for the purpose and closed
#' afterwards, whatever happens; one made by [gym_make()] is left open, in its last
#' episode.
#'
#' An episode's return is the sum of its rewards, its length the number of its
#' steps. Everything that is drawn, the seeds of the episodes and the actions of a random policy,
#' follows from one whole number, `seed`. Without one it is drawn from R's generator, which moves by
#' this one draw only; so [set.seed()] fixes everything, too, but for a policy that is made in the
#' call, whose weights are the caller's to draw.
#'
#' # Two ways to play
#'
#' **Beside the environment**: the policy is sent to the server, whose processes play whole episodes
#' with it. This is the way where the environment is named by its id (with arguments, and wrappers
#' of [gym_wrap()]) and the policy is data: [policy_random()], [policy_network()],
#' [policy_linear()], [policy_table()], [policy_candidates()] and lists of these. An episode then
#' depends on the environment, the policy, its seed and `max_steps` alone, what its policy draws
#' included: not on how many processes play, nor on what else is played.
#'
#' **Step by step**, everything else: R is asked for the actions of each step. This is so for
#' functions, models and other policies that only R can ask; for an environment that was made
#' before, or that is written in R; with `frames = TRUE`; for wrappers that remember earlier
#' episodes; where an episode might go on forever, as neither the environment nor `max_steps` limits
#' it; where a vector implementation such as CartPole's is to play with another `num_envs` than 256;
#' and on a server that is older than this package. Many episodes are played at once in
#' sub-environments, but for frames, and the policy is asked about those that still run, so that a
#' function gets fewer rows as the last of them end.
#'
#' [provenance()] names the way. `vignette("playing", package = "gym")` tells more, and how to begin
#' an episode of the result again.
#'
#' # Steps as arrays
#'
#' Those who write learners want the steps by time, of all sub-environments at once. With
#' `steps = "arrays"` they are a list of arrays whose first dimension is the time and whose second
#' are the sub-environments:
#' * `observation` and, where asked for, `next_observation`: with the dimensions of an observation
#'   after these two, such as 120 x 16 x 4,
#' * `action`: with those of an action, none for a Discrete space,
#' * `reward` (double), `terminated`, `truncated` (logical), `episode` and, with several policies,
#'   `candidate` (integer): matrices.
#'
#' A sub-environment's episodes follow one another. Where it has played fewer steps than another
#' the arrays have `NA` after its last one. Tuple and Dict have a list with an array for each part;
#' Sequence, Graph and OneOf have no arrays.
#'
#' @param env The environment: an id, such as `"CartPole-v1"` (perhaps with wrappers,
#'   see [gym_wrap()]), or an environment made by [gym_make()], with sub-environments or without.
#' @param policy The policy: made by [policy_random()] or [policy_network()], or a function of
#'   many observations that returns as many actions: for the usual environments a function of a
#'   matrix with an observation in each row, one for each episode that still plays, see [act()];
#'   [as_policy()] makes one of a fitted model. A training plays as its policy. Or several of them,
#'   the candidates, which are played side by side: a list of policies, [policy_candidates()], or
#'   trainings with several seeds.
#' @param episodes How many episodes to play, with each of the candidates, a whole number of at
#'   least 1; the default is 1.
#' @param max_steps After how many steps to cut an episode short, a whole number of
#'   at least 1. Such an episode counts as truncated. `NULL`, the default, leaves it
#'   to the environment; most have a limit of their own, but without one a policy
#'   that never fails plays forever. No episode goes on beyond the environment's own limit;
#'   `gym_make("MountainCar-v0", max_episode_steps = 1000)` makes one with another.
#' @param seed A whole number of at most 2^53 that fixes all that is drawn, whatever [RNGkind()] the
#'   session has; the session's generator stays as it was. `NULL`, the default, draws one from the
#'   session's generator.
#' @param steps Keep each step as well? `FALSE`, the default, `TRUE` for a table, or `"arrays"`.
#' @param client The client of the server where an environment named by its id is
#'   made; the default is the session's own, [gym_client()].
#' @param frames Keep pictures of the episodes as well? `FALSE`, the default, or `TRUE`, for
#'   [animate()] and [plot(type = "filmstrip")][plot.gym_rollout()]: one before the first
#'   step and one after each. Takes an environment that can be drawn, without sub-environments.
#' @param ... The environment's own arguments, by name, such as `is_slippery = FALSE` for
#'   FrozenLake, where it is named by its id.
#' @param num_envs How many sub-environments to play in, a whole number, where the environment is
#'   named by its id; beside the environment, over how many the column `sub_env` and arrays deal out
#'   the episodes. `NULL`, the default, chooses, see [as_vector_env()].
#' @param next_observation Keep the observation after each step as well, in columns whose names
#'   begin with `next_`, such as `next_pole_angle`? `FALSE`, the default, or `TRUE`; only where
#'   steps are kept. It is the true one also where the step ended the episode.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param num_workers How many processes of the server run the sub-environments where R plays step
#'   by step, a whole number; 0 for none but the server itself. What is played does not depend on
#'   it. `NULL`, the default, lets the server choose, see [as_vector_env()]. Only where the
#'   environment is named by its id and has no vector implementation of its own, such as CartPole
#'   has. Beside the environment the server chooses.
#' @return An object of class `gym_rollout`, which [print()], [summary()],
#'   [plot()][plot.gym_rollout()] and [as.data.frame()] know; a list with the
#'   elements
#'   \describe{
#'     \item{episodes}{A data frame with one row for each episode: `candidate` (integer, with
#'       several policies only; `episode` then counts those of each), `episode`, `seed`,
#'       `sub_env` (integers; 1 where there are no sub-environments), `return` (double), `length`
#'       (integer, in steps), `terminated` (logical: ended by the environment's own
#'       rules), `truncated` (logical: cut short by a limit of steps; an episode that ends
#'       by both at once is both where the limit is the environment's own).}
#'     \item{steps}{`NULL`, or with `steps = TRUE` a data frame with one row for each
#'       step: `candidate` as above, `episode`, `step` (integers), the observation that the action
#'       was taken on (in columns named as in Gymnasium's documentation, such as `pole_angle`,
#'       elsewhere `obs_1`, `obs_2`, ..., with the keys of a Dict such as
#'       `obs_position_1`), `action` (or `action_1`, `action_2`, ...),
#'       `reward` (double), `terminated`, `truncated` (logical), and with
#'       `next_observation = TRUE` the observation after the step. With `steps = "arrays"` an object
#'       of class `gym_arrays`, see below.}
#'     \item{frames}{`NULL`, or with `frames = TRUE` a list with the frames of each episode, an
#'       object of class `gym_frames`. They are kept as PNG files, a few kilobytes each:
#'       `frames[[2]][[1]]` unpacks the first of the second episode, as [env_render()] gives
#'       it (with package png).}
#'     \item{policy}{The policy played.}
#'     \item{env_id}{The environment's id, a string.}
#'     \item{num_envs}{How many sub-environments share the seed of an episode, an integer, of which
#'       `sub_env` is one; `NULL` where each episode has a seed of its own.}
#'     \item{seed}{The seed, as given or drawn: with it the same call gives the same result.}
#'     \item{interrupted}{Whether it was interrupted, a logical. Then it has the episodes that were
#'       finished; where R plays step by step, the batches of episodes.}
#'     \item{provenance}{What [provenance()] tells.}
#'   }
#'   `as.data.frame()` gives the table of steps where there is one, otherwise that of
#'   the episodes.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be
#'   (before anything is made), a policy that does not fit the environment, or a function
#'   that does not return one action for each observation;
#'   `gym_error_http` when the server refuses the environment or an action;
#'   `gym_error_connection` when it does not answer. An error in the middle has the class
#'   `gym_error_rollout`, too, and the episodes (step by step the batches of episodes) before it are
#'   the element `result` of the condition.
#' @section Warnings: `gym_warning_max_steps` for a `max_steps` beyond the environment's own limit.
#' @seealso [search_random()]
#' @export
#' @examplesIf gym:::can_start_server()
#' random <- rollout("CartPole-v1", policy_random(), episodes = 20, seed = 1)
#' random
#' summary(random)
#'
#' # Any function of a matrix of observations can be a policy, and each step be kept.
#' follow_pole <- function(observation) as.integer(observation[, "pole_angle"] > 0)
#' played <- rollout("CartPole-v1", follow_pole, episodes = 2, seed = 1, steps = TRUE)
#' head(as.data.frame(played))
#'
#' # The returns from each step on, discounted by 0.99, in all sub-environments at once.
#' arrays <- rollout("CartPole-v1", follow_pole, episodes = 20, seed = 1, steps = "arrays")$steps
#' arrays
#' from_here <- arrays$reward
#' ended <- arrays$terminated | arrays$truncated
#' for (time in rev(seq_len(nrow(ended) - 1))) {
#'   later <- ifelse(ended[time, ], 0, from_here[time + 1, ])
#'   from_here[time, ] <- arrays$reward[time, ] + 0.99 * later
#' }
#' from_here[1, ]
#'
#' # The second episode begins again.
#' second <- played$episodes[2, ]
#' env <- gym_make("CartPole-v1", num_envs = played$num_envs)
#' env$reset(seed = second$seed)[second$sub_env, ]
#' env$close()
#'
#' # Where each episode has a seed of its own, a single environment will do.
#' lake <- rollout("FrozenLake-v1", policy_random(), episodes = 2, seed = 1)
#' env <- gym_make("FrozenLake-v1")
#' env$reset(seed = lake$episodes$seed[2])
#' env$close()
rollout <- function(env, policy, episodes = 1, max_steps = NULL, seed = NULL, steps = FALSE,
                    client = gym_client(), frames = FALSE, ..., num_envs = NULL,
                    next_observation = FALSE, progress = rlang::is_interactive(),
                    num_workers = NULL) {
  check_environment(env)
  policy <- check_policies(policy)
  check_count(episodes)
  check_count(max_steps, allow_null = TRUE)
  check_seed(seed)
  check_steps_wanted(steps, next_observation)
  check_flag(frames)
  check_count(num_envs, allow_null = TRUE)
  check_count(num_workers, min = 0, allow_null = TRUE)
  check_flag(progress)
  check_dots_named(list(...), "is_slippery = FALSE")
  candidates <- count_candidates(policy) %||% 1L
  # The numbers of all episodes together are integers.
  most <- .Machine$integer.max %/% candidates
  if (episodes > most) {
    must <- paste("at most", most, "for each of", count_of(candidates, "candidate"))
    abort_argument(episodes, must, "episodes", rlang::current_env())
  }
  seed <- seed %||% draw_seed()
  play <- function(vector_env) {
    play_rollout(
      vector_env, policy, candidates, episodes, max_steps, seed, steps, next_observation, progress
    )
  }
  with_vector_env(
    env, candidates * episodes, play, max_steps, num_envs = num_envs, ..., frames = frames,
    client = client, num_workers = num_workers, seed = seed
  )
}

check_steps_wanted <- function(steps, next_observation, call = rlang::caller_env()) {
  if (!is_flag(steps) && !identical(steps, "arrays")) {
    abort_argument(steps, "TRUE, FALSE or \"arrays\"", "steps", call)
  }
  check_flag(next_observation, call = call)
  if (next_observation && isFALSE(steps)) {
    gym_abort(
      c("`next_observation = TRUE` needs the steps to be kept.",
        i = "Add `steps = TRUE`, or `steps = \"arrays\"`."),
      class = "gym_error_argument", argument = "next_observation", value = TRUE, call = call
    )
  }
}

play_rollout <- function(vector_env, policy, candidates, episodes, max_steps, seed, steps,
                         next_observation, progress) {
  if (identical(steps, "arrays")) {
    check_fits_arrays(vector_env)
  }
  policy <- policy_bind(policy, vector_env, call = vector_env$call)
  vector_env <- env_for_policy(vector_env, policy, max_steps %||% Inf, !isFALSE(steps))
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
        max_steps = max_steps %||% Inf, keep_steps = !isFALSE(steps), keep_next = next_observation
      ),
      "Interrupted after {finished} of {total} episode{?s}; what was finished is returned.",
      function() history$played_episodes, total
    ),
    error = function(cnd) {
      if (!history$played_episodes) {
        rlang::cnd_signal(cnd)
      }
      played <- count_of(history$played_episodes, "episode")
      abort_with_result(
        cnd, "The rollout", result(), played, "gym_error_rollout", vector_env$call
      )
    }
  )
  result(interrupted)
}

new_rollout <- function(history, policy, vector_env, origin, steps, next_observation, interrupted) {
  several <- !is.null(count_candidates(policy))
  episodes <- episodes_table(history$batches, several)
  fps <- vector_env$spec$render_fps
  keep <- if (identical(steps, "arrays")) steps_arrays else steps_table
  structure(
    list(
      episodes = episodes,
      steps = if (!isFALSE(steps) && nrow(episodes)) {
        keep(history$batches, episodes, vector_env, several, next_observation)
      },
      frames = if (!is.null(vector_env$frame)) {
        lapply(unlist(lapply(history$batches, function(batch) batch$frames), recursive = FALSE),
               new_frames, fps = fps)
      },
      policy = policy,
      env_id = environment_label(vector_env),
      num_envs = if (vector_env$one_seed) vector_env$num_envs,
      seed = origin$seed,
      interrupted = interrupted,
      provenance = origin
    ),
    class = "gym_rollout"
  )
}

#' @export
as.data.frame.gym_rollout <- function(x, row.names = NULL, optional = FALSE, ...) {
  if (is.data.frame(x$steps)) x$steps else x$episodes
}

#' @rdname rollout
#' @param object What `rollout()` returned.
#' @param newdata,type As for [predict()][predict.gym_policy()] of a policy.
#' @export
predict.gym_rollout <- function(object, newdata, type = c("action", "output"), ...) {
  type <- check_choice(type[1L], c("action", "output"), arg = "type")
  predict_policy(object$policy, newdata, type)
}

# Printing and summarising ---------------------------------------------------------

#' @export
print.gym_rollout <- function(x, ...) {
  cat(rollout_lines(x), sep = "\n")
  if (!is.null(x$episodes$candidate)) {
    print_candidates(evaluate_episodes(x$episodes, x$policy))
  }
  invisible(x)
}

rollout_lines <- function(x) {
  returns <- x$episodes$return
  c(
    paste0("Rollout in ", x$env_id, ": ", count_of(length(returns), "episode"), ", ",
           count_of(sum(x$episodes$length), "step")),
    paste0("Policy: ", policy_text(x$policy)),
    if (is.null(x$episodes$candidate)) paste0("Return: ", returns_text(returns))
  )
}

returns_text <- function(returns) {
  if (length(returns) < 2L) {
    return(if (length(returns)) number_text(returns) else "none")
  }
  paste0(
    "mean ", number_text(mean(returns)), se_text(standard_error(returns)),
    ", median ", number_text(stats::median(returns)),
    ", from ", number_text(min(returns)), " to ", number_text(max(returns))
  )
}

#' Summarise a rollout
#'
#' @param object What [rollout()] returned.
#' @param ... Not used.
#' @return An object of class `summary.gym_rollout`, a list with the elements
#'   `env_id` (a string), `policy`, `episodes` and `steps` (how many, integers),
#'   `returns` and `lengths` (the quartiles and the mean, named numeric vectors of
#'   length 6), `mean` and `se` (the mean return and its standard error, doubles; the
#'   latter `NA` for a single episode), `terminated` and `truncated` (how many
#'   episodes ended so, integers), `candidates` (`NULL`, or of several policies a row for each, as
#'   [evaluate_policy()] has it).
#' @export
#' @examplesIf gym:::can_start_server()
#' summary(rollout("CartPole-v1", policy_random(), episodes = 20, seed = 1))
summary.gym_rollout <- function(object, ...) {
  episodes <- object$episodes
  structure(
    list(
      env_id = object$env_id,
      policy = object$policy,
      episodes = nrow(episodes),
      steps = sum(episodes$length),
      returns = quartiles(episodes$return),
      lengths = quartiles(episodes$length),
      mean = mean(episodes$return),
      se = standard_error(episodes$return),
      terminated = sum(episodes$terminated),
      truncated = sum(episodes$truncated),
      candidates = if (!is.null(episodes$candidate)) evaluate_episodes(episodes, object$policy)
    ),
    class = "summary.gym_rollout"
  )
}

#' @export
print.summary.gym_rollout <- function(x, ...) {
  cat(
    paste0("Rollout in ", x$env_id, ": ", count_of(x$episodes, "episode"), ", ",
           count_of(x$steps, "step")),
    paste0("Policy: ", policy_text(x$policy)),
    if (is.null(x$candidates)) paste0("Mean return: ", number_text(x$mean), se_text(x$se)),
    paste0("Terminated: ", x$terminated, ", truncated: ", x$truncated),
    "",
    sep = "\n"
  )
  if (!is.null(x$candidates)) {
    print_candidates(x$candidates)
    return(invisible(x))
  }
  print(signif(rbind(return = x$returns, length = x$lengths), 4L))
  invisible(x)
}

quartiles <- function(x) {
  five <- stats::quantile(x, names = FALSE)
  c(Min. = five[[1L]], `1st Qu.` = five[[2L]], Median = five[[3L]], Mean = mean(x),
    `3rd Qu.` = five[[4L]], Max. = five[[5L]])
}

# NA for a single episode, which has no standard error.
standard_error <- function(x) stats::sd(x) / sqrt(length(x))
