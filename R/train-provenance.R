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
