# The result of a training: class gym_training.

#' Make the result of a training
#' @param state As train_in() makes it; only finished iterations count.
#' @noRd
training_result <- function(settings, state, interrupted = FALSE) {
  search <- settings$search
  history <- rows_table(state$history, no_iterations)
  structure(
    c(
      list(
        # A search that has played no round has no policy.
        policy = if (!search || state$iteration > 0L) judged_policy(settings, state$agent),
        agent = state$agent,
        solved = if (search) {
          # By the tutorial's rule there is no final evaluation.
          state$solved
        } else if (has_target(settings)) {
          reaches(state$final$mean_return, settings$target)
        } else {
          NA
        },
        stopped_early = state$solved,
        history = history,
        evaluations = rows_table(state$evaluations, no_evaluations),
        final = state$final,
        target = settings$target,
        env_id = settings$env_id,
        env = settings$env,
        kwargs = settings$kwargs,
        seed = settings$seed,
        steps = state$steps,
        elapsed = now() - state$started,
        interrupted = interrupted,
        max_steps = settings$max_steps,
        rules = settings[c(kept_rules, "eval_steps")],
        provenance = settings$provenance
      ),
      if (search) search_parts(settings, state, history)
    ),
    class = c(if (search) "gym_search", "gym_training")
  )
}

# Combines rows (lists or data frames) into a data frame. Without rows it returns `none`.
rows_table <- function(rows, none) {
  if (!length(rows)) {
    return(none)
  }
  columns <- lapply(stats::setNames(nm = names(rows[[1L]])), function(name) {
    unlist(lapply(rows, `[[`, name))
  })
  list2DF(columns)
}

no_iterations <- data.frame(
  iteration = integer(), steps = numeric(), min_return = numeric(), median_return = numeric(),
  mean_return = numeric(), max_return = numeric(), mean_length = numeric(),
  evaluation = numeric(), elapsed = numeric()
)

no_evaluations <- data.frame(
  iteration = integer(), kind = character(), mean_return = numeric(), se = numeric(),
  lower = numeric(), upper = numeric(), episodes = integer(), steps = integer()
)

#' @export
as.data.frame.gym_training <- function(x, row.names = NULL, optional = FALSE, ...) {
  check_no_curve(...)
  x$history
}

# Ignoring this argument would return another table than the user asked for.
check_no_curve <- function(..., call = rlang::caller_env()) {
  abort_if(
    any(c("curve", "curves") %in% ...names()),
    "curve", NULL, call, "`as.data.frame()` has no argument `curve`.",
    i = "`learning_curves()` gives the evaluations of all seeds and trainings."
  )
}

#' @export
print.gym_training <- function(x, ...) print_lines(x, training_lines(x))

training_lines <- function(x) {
  search <- inherits(x, "gym_search")
  outcome <- if (x$interrupted) {
    "Interrupted after"
  } else if (x$stopped_early) {
    if (search) "Solved after" else "Stopped early after"
  } else {
    "Played"
  }
  target <- if (!is.null(x$target)) paste0(" (target ", number_text(x$target), ")")
  c(
    paste0("Training in ", env_text(x), " by ",
           if (search) "random search" else format(x$agent)),
    paste0("Policy: ", policy_text(x$policy %||% x$template)),
    paste0(
      outcome, " ", count_of(nrow(x$history), if (search) "round" else "iteration"), ", ",
      count_of(x$steps, "step"), elapsed_text(x$elapsed), target
    ),
    if (search && !nrow(x$rounds)) {
      "Ended before the first round was played to its end"
    } else if (search) {
      paste0("Best of ", count_of(nrow(x$rounds), "round"), ": round ", x$round, ", mean return ",
             number_text(x$rounds$mean_return[[x$round]]), " in ",
             count_of(nrow(x$episodes) / nrow(x$rounds), "episode"))
    },
    if (is_exact(x$final)) {
      apart <- x$rules$eval_steps %||% 0
      c(
        paste0("Expected return, by the model: ", number_text(x$final$mean_return),
               verdict_text(x)),
        paste0("Evaluated ", count_of(length(unique(x$evaluations$iteration)), "time"),
               ": eval_every ", number_text(x$rules$eval_every),
               if (apart > 0) paste0(", at least ", count_of(apart, "step"), " apart"))
      )
    } else if (!is.null(x$final)) {
      paste0("Mean return in ", count_of(x$final$episodes, "fresh episode"), ": ",
             evaluation_text(x$final), verdict_text(x))
    }
  )
}

# Says whether the final evaluation has reached the target.
verdict_text <- function(x) {
  if (has_target(x)) {
    paste0(", target ", if (x$solved) "reached" else "not reached")
  }
}

# Was it evaluated exactly, without playing an episode?
is_exact <- function(row) isTRUE(row$episodes == 0)

evaluation_text <- function(row) {
  if (is_exact(row)) {
    return(paste(number_text(row$mean_return), "(exact)"))
  }
  paste0(number_text(row$mean_return), se_text(row$se), ", ", interval_text(row$lower, row$upper))
}

#' @export
predict.gym_training <- function(object, newdata,
                                 type = c("action", "output", "probability"), ...) {
  type <- check_choice(type[1L], c("action", "output", "probability"), arg = "type")
  check_found(object)
  predict_policy(object$policy, newdata, type)
}

#' @export
coef.gym_training <- function(object, ...) {
  check_dots_empty(...)
  stats::coef(object$policy)
}

# The steps of the training before each evaluation.
evaluation_steps <- function(x) c(0, x$history$steps)[x$evaluations$iteration + 1L]

# What a row of the history summarises. An agent that learns from steps plays one policy, so its
# rows summarise episodes.
returned_unit <- function(agent) {
  by_steps <- learns_online(agent) || "trajectories" %in% agent_needs(agent)
  if (by_steps) "episodes" else "candidates"
}

# print() shows all that there is to sum up.
#' @export
summary.gym_training <- function(object, ...) object

# Its provenance -----------------------------------------------------------------------

#' Show how a result was made
#'
#' Every result records how it was made: versions, system, the library of linear algebra (whose sums
#' differ in the last bits between machines), environment, seeds and time. `provenance()` returns
#' this record, also for a checkpoint file.
#'
#' @param x The result of [rollout()], [evaluate_policy()], [train_agent()] or [search_random()]; or
#'   the file of a checkpoint, a string.
#' @param ... Not used.
#' @return An object of class `gym_provenance`, which prints a line for each element. It is a list
#'   of
#'   * `gym`, `R`, `platform`, `system`, `BLAS`, `LAPACK`: strings,
#'   * `server`: the versions of the server and of the simulator (such as MuJoCo, Box2D or jax), a
#'     named list of strings; `NULL` for an environment in R,
#'   * `processor`: a string; the server's processor if its processes play, because the last bits of
#'   NumPy's results depend on it,
#'   * `way`: `"beside the environment"` or `"step by step"`, see [rollout()]; for a learner, how it
#'   learns,
#'   * `env_id` (a string), `kwargs` (the environment's arguments, a named list), `wrappers`
#'   (strings),
#'   * `num_envs`: a whole number; `NULL` beside the environment,
#'   * `seed` (whole numbers), `preset` (a list, or `NULL`),
#'   * `started` (a date with time) and `elapsed` (seconds, a double). Rollouts and evaluations have
#'   no times, `NULL` and `NA`, so that two with the same seed are identical.
#' @section Errors: `gym_error_argument` for an object without provenance, `gym_error_checkpoint`
#'   for a file that is not a checkpoint.
#' @export
#' @examplesIf gym:::can_start_server()
#' provenance(rollout("CartPole-v1", policy_random(), episodes = 10, seed = 1))
provenance <- function(x, ...) UseMethod("provenance")

#' @export
provenance.default <- function(x, ...) {
  kept <- if (is.data.frame(x)) attr(x, "provenance") else if (is.list(x)) x$provenance
  if (!inherits(kept, "gym_provenance")) {
    abort_argument(x, "a result of this package, or the file of a checkpoint", "x",
                   rlang::current_env())
  }
  if (is.list(x) && is_number(x$elapsed)) {
    kept$elapsed <- x$elapsed
  }
  kept
}

#' @export
provenance.character <- function(x, ...) {
  call <- rlang::current_env()
  check_string(x)
  if (!file.exists(x)) {
    abort_argument(x, "a file that exists, or a result of this package", "x", call)
  }
  saved <- read_checkpoint(x, call)
  kept <- saved$provenance
  kept$seed <- saved$seed
  kept$elapsed <- saved$elapsed
  kept
}

# Searches -------------------------------------------------------------------------------

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
#' A round plays few episodes, so the best of many rounds owes part of its mean return to luck, and
#' this mean is an overestimate. That is why `summary()` plays the policy again. By Gym's own
#' definition, an environment is solved by a mean return of at least its threshold over 100
#' consecutive episodes.
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
  abort_if(
    is.null(object$policy), "object", object, call,
    "The search has no policy: it ended before the first round was played to its end."
  )
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
  fresh <- nrow(x$fresh$episodes)
  verdict <- if (!is.null(x$search$target)) {
    paste0(", target ", number_text(x$search$target), if (x$reached) " reached" else " not reached")
  }
  print_lines(x, c(
    training_lines(x$search), "",
    paste0("The policy found, in ", count_of(fresh, "fresh episode"), ":"),
    paste0("mean return ", number_text(x$mean), se_text(x$se), verdict)
  ))
}
