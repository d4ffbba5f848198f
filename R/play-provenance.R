# Where a result comes from: what must be known to get it again, or to see why it came out otherwise.

#' Where a result comes from
#'
#' Every result keeps what made it: versions, system, the library of linear algebra (whose sums
#' differ in the last bits from machine to machine), environment, seeds and time. `provenance()`
#' gives it, also of the file of a checkpoint.
#'
#' @param x A result: what [rollout()], [evaluate_policy()], [train_agent()], [search_random()] or
#'   [search_repeat()] returned; or the file of a checkpoint, a string.
#' @param ... Not used.
#' @return An object of class `gym_provenance`, which prints a line for each of its elements; a list
#'   of `gym`, `R`, `platform`, `system`, `BLAS`, `LAPACK` (strings), `server` (the versions of the
#'   server, a named list of strings; `NULL` for an environment in R), `env_id` (a string), `kwargs`
#'   (the environment's own arguments, a named list), `wrappers` (strings), `num_envs`, `seed` (whole
#'   numbers), `preset` (a list, `NULL` where none was taken), `started` (a date with time) and
#'   `elapsed` (seconds, a double). Rollouts and evaluations have no times, `NULL` and `NA`, so that
#'   two with the same seed are identical.
#' @section Errors: `gym_error_argument` for something that has no provenance,
#'   `gym_error_checkpoint` for a file that is no checkpoint.
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

new_provenance <- function(vector_env, settings, started = Sys.time()) {
  system <- Sys.info()
  session <- utils::sessionInfo()
  structure(
    list(
      gym = as.character(utils::packageVersion("gym")),
      R = as.character(getRversion()),
      platform = R.version$platform,
      system = paste(system[["sysname"]], system[["release"]]),
      BLAS = session$BLAS %||% NA_character_,
      LAPACK = session$LAPACK %||% NA_character_,
      server = server_versions(vector_env$client),
      env_id = environment_label(vector_env),
      kwargs = vector_env$spec$kwargs %||% settings$kwargs %||% list(),
      wrappers = as.character(vector_env$spec$wrappers),
      num_envs = vector_env$num_envs,
      seed = settings$seed,
      preset = settings$agent$preset,
      started = started,
      elapsed = NA_real_
    ),
    class = "gym_provenance"
  )
}

#' @export
format.gym_provenance <- function(x, ...) {
  named <- function(values) paste(names(values), vapply(values, short_text, ""), collapse = ", ")
  lines <- c(
    gym = x$gym, R = x$R, platform = x$platform, system = x$system, BLAS = x$BLAS,
    LAPACK = x$LAPACK, server = if (length(x$server)) named(x$server),
    environment = x$env_id, arguments = if (length(x$kwargs)) named(x$kwargs),
    wrappers = if (length(x$wrappers)) paste(x$wrappers, collapse = ", "),
    `sub-environments` = as.character(x$num_envs),
    seed = if (length(x$seed)) paste(format(x$seed, scientific = FALSE, trim = TRUE),
                                     collapse = ", "),
    preset = if (!is.null(x$preset)) x$preset$origin,
    started = if (!is.null(x$started)) format(x$started, "%Y-%m-%d %H:%M:%S %Z"),
    elapsed = if (!is.na(x$elapsed)) seconds_text(x$elapsed)
  )
  paste(format(paste0(names(lines), ":")), lines)
}

short_text <- function(value) {
  if (is.character(value) && length(value) == 1L) value else describe_value(value)
}

#' @export
print.gym_provenance <- function(x, ...) {
  writeLines(format(x))
  invisible(x)
}
