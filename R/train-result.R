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
        # A search has not found a policy that was never played.
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
        elapsed = proc.time()[["elapsed"]] - state$started,
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

# Combines rows, lists or data frames, into a data frame; `none` is the one without rows.
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
  if (any(c("curve", "curves") %in% ...names())) {
    abort_wrong(
      "curve", NULL, call, "`as.data.frame()` has no argument `curve`.",
      i = "`learning_curves()` gives the evaluations of all seeds and trainings."
    )
  }
}

#' @export
print.gym_training <- function(x, ...) {
  cat(training_lines(x), sep = "\n")
  invisible(x)
}

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

# What the final evaluation says of the target.
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

# What the row of an iteration describes: an agent that learns from steps plays one policy.
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
#'   * `server`: the versions of the server, and of what simulates the environment (such as MuJoCo,
#'     Box2D or jax), a named list of strings; `NULL` for an environment in R,
#'   * `processor`: a string; the server's processor if its processes play, because the last bits of
#'   NumPy depend on it,
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
