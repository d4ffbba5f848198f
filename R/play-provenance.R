# How a result was made: what you need to get it again, or to see why another one differs.

new_provenance <- function(vector_env, settings, started = Sys.time()) {
  system <- Sys.info()
  # NumPy calculates what policies do that play on the server.
  versions <- playing_versions(vector_env) %||% vector_env$model$versions
  described <- vector_env$description$versions
  way <- if (!is.null(vector_env$model)) {
    "from the model in R"
  } else if (is.null(vector_env$description)) {
    "step by step"
  } else {
    "beside the environment"
  }
  structure(
    list(
      gym = as.character(utils::packageVersion("gym")),
      R = as.character(getRversion()),
      platform = R.version$platform,
      system = paste(system[["sysname"]], system[["release"]]),
      BLAS = extSoftVersion()[["BLAS"]],
      LAPACK = La_library(),
      server = c(versions, described[setdiff(names(described), names(versions))]),
      processor = vector_env$description$processor,
      way = way,
      env_id = environment_label(vector_env),
      kwargs = vector_env$spec$kwargs %||% settings$kwargs %||% list(),
      wrappers = as.character(vector_env$spec$wrappers),
      num_envs = if (is.null(vector_env$description)) vector_env$num_envs,
      seed = settings$seed,
      preset = settings$agent$preset,
      started = started,
      elapsed = NA_real_
    ),
    class = "gym_provenance"
  )
}

# The versions of the server and of what simulates the environment, such as MuJoCo; `NULL` without a
# server. Episodes may differ from one version to another.
playing_versions <- function(vector_env) {
  c(server_versions(vector_env$client), vector_env$spec$engine)
}

#' @export
format.gym_provenance <- function(x, ...) {
  named <- function(values) paste(names(values), vapply(values, short_text, ""), collapse = ", ")
  lines <- c(
    gym = x$gym, R = x$R, platform = x$platform, system = x$system, BLAS = x$BLAS,
    LAPACK = x$LAPACK, server = if (length(x$server)) named(x$server),
    processor = x$processor, played = x$way,
    environment = x$env_id, arguments = if (length(x$kwargs)) named(x$kwargs),
    wrappers = if (length(x$wrappers)) paste(x$wrappers, collapse = ", "),
    `sub-environments` = if (length(x$num_envs)) as.character(x$num_envs),
    seed = if (length(x$seed)) paste(format(x$seed, scientific = FALSE, trim = TRUE),
                                     collapse = ", "),
    preset = if (!is.null(x$preset)) x$preset$origin,
    started = if (!is.null(x$started) && prints_times()) {
      format(x$started, "%Y-%m-%d %H:%M:%S %Z")
    },
    elapsed = if (!is.na(x$elapsed)) elapsed_text(x$elapsed, "")
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
