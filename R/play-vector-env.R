# The first and last part of everything that plays: get a vector environment and give it back.

#' Call a function with the vector environment of an environment
#'
#' A vector environment that was made for this is closed when `play` returns.
#' @param episodes The largest number of episodes.
#' @param play A function of the vector environment.
#' @param max_steps The user's value. A smaller limit of the environment gives a warning.
#' @param ... Further arguments of [as_vector_env()].
#' @param client The user's client. Its default starts a server, so it is only passed on: a method
#'   for an environment without a server never evaluates it.
#' @param seed The seed of a random map, see [with_random_map()].
#' @noRd
with_vector_env <- function(env, episodes, play, max_steps = NULL, ..., client = gym_client(),
                            seed = NULL, call = rlang::caller_env()) {
  # Errors from making the environment should name the user's call, too.
  rlang::local_error_call(call)
  arguments <- with_random_map(env, list(...), seed)
  made <- NULL
  finished <- FALSE
  on.exit(if (!is.null(made)) made$close(wait = finished))
  complete <- function(vector_env) {
    vector_env$call <- call
    vector_env$recipe <- environment_recipe(env, vector_env, arguments)
    vector_env
  }
  make <- function() {
    if (is.null(made)) {
      vector_env <- naming_own_call(
        rlang::inject(as_vector_env(env, !!!arguments, client = client, max_envs = episodes)),
        "as_vector_env", call
      )
      made <<- complete(vector_env)
      inform_of_memory(made, env)
      if (calls_r(env) && is_made_by_server(env)) inform_calls_r(made)
    }
    made
  }
  vector_env <- describe_to_play(env, arguments, client, call)
  if (is.null(vector_env)) {
    vector_env <- make()
  } else {
    vector_env <- complete(vector_env)
    vector_env$make_stepped <- make
  }
  warn_of_own_limit(max_steps, vector_env, call)
  value <- play(vector_env)
  finished <- TRUE
  value
}

# Arguments about sub-environments are not arguments of the environment.
describe_to_play <- function(env, arguments, client, call) {
  of_sub_envs <- rlang::names2(arguments) %in% c("num_envs", "num_workers", "frames")
  given <- arguments[of_sub_envs]
  check_count(given$num_envs, allow_null = TRUE, arg = "num_envs", call = call)
  check_count(given$num_workers, min = 0, allow_null = TRUE, arg = "num_workers", call = call)
  described <- describe_env(
    env, arguments[!of_sub_envs], client, given$num_envs, isTRUE(given$frames), call = call
  )
  if (isTRUE(described$one_seed)) check_no_workers(given$num_workers, call)
  described
}

# `max_steps` cannot extend the environment's own limit.
warn_of_own_limit <- function(max_steps, vector_env, call) {
  own <- vector_env$spec$max_episode_steps
  if (!is.null(max_steps) && !is.null(own) && own < max_steps) {
    wanted <- format(max_steps, scientific = FALSE)
    id <- environment_label(vector_env)
    rlang::warn(
      c(paste0("`max_steps = ", wanted, "` makes no episode longer: ", id,
               " has a limit of its own, ", count_of(own, "step"), "."),
        i = paste0("`max_episode_steps = ", wanted, "` as a further argument of `gym_make()` ",
                   "sets another limit; a TimeLimit wrapper can only lower it.")),
      class = "gym_warning_max_steps", call = call
    )
  }
}

# Only if it was decided here to play one episode after the other.
inform_of_memory <- function(vector_env, env) {
  if (length(vector_env$remembers) && is_given_by_id(env)) {
    rlang::inform(
      c(i = paste0(paste(vector_env$remembers, collapse = " and "), " remembers earlier episodes, ",
                   "so they are played one after the other, in one batch.")),
      class = "gym_message_remembers"
    )
  }
}

inform_calls_r <- function(vector_env) {
  names <- intersect(names(transforms), vector_env$spec$wrappers)
  rlang::inform(
    c(i = paste0(paste(names, collapse = " and "), " calls an R function in each step, so R plays ",
                 "step by step, which takes longer than playing on the server.")),
    class = "gym_message_calls_r", .frequency = "once", .frequency_id = "gym_calls_r"
  )
}

# Interrupts and progress ---------------------------------------------------------------

#' Play until the end or an interrupt
#'
#' @param play Code that plays.
#' @param text A message for an interrupt, for cli, with `{finished}` and, if given, `{total}`.
#' @param count_finished A function that returns the number of finished ones, or a text.
#' @return Whether there was an interrupt, logical.
#' @noRd
until_interrupted <- function(play, text, count_finished, total = NULL) {
  tryCatch(
    {
      play
      FALSE
    },
    interrupt = function(cnd) {
      finished <- count_finished()
      cli::cli_inform(c("!" = text), class = "gym_message_interrupted")
      TRUE
    }
  )
}

#' Show a progress bar until the calling function ends
#'
#' If the package progressr is loaded, its handlers are informed, too.
#' @param unit The unit, a word such as `"Round"`.
#' @param note The text before the remaining time.
#' @param shown Whether to show the bar.
#' @return A function of the number of finished units and the new `note`.
#' @noRd
progress_bar <- function(total, unit, note = "", shown = TRUE, frame = parent.frame()) {
  bar <- if (shown) cli_bar(total, unit, note, frame) else function(finished, note) NULL
  signal <- progress_signal(total, frame)
  function(finished, note = "") {
    bar(finished, note)
    signal(finished, note)
  }
}

cli_bar <- function(total, unit, note, frame) {
  bar <- cli::cli_progress_bar(
    total = total,
    format = paste(
      unit, "{cli::pb_current} of {cli::pb_total} {cli::pb_bar}",
      "{cli::pb_extra$note}{cli::pb_eta_str}"
    ),
    extra = list(note = note),
    .envir = frame
  )
  shown <- 0
  function(finished, note) {
    # A finished bar no longer exists.
    if (shown < total) {
      shown <<- finished
      cli::cli_progress_update(
        id = bar, set = finished, extra = list(note = note), .envir = frame
      )
    }
  }
}

# At most a hundred signals, because each takes a while.
progress_signal <- function(total, frame) {
  if (!"progressr" %in% loadedNamespaces()) {
    return(function(finished, note) NULL)
  }
  progress <- progressr::progressor(steps = total, envir = frame)
  told <- 0
  function(finished, note) {
    if (finished - told >= total / 100 || finished >= total && told < total) {
      progress(note, amount = finished - told)
      told <<- finished
    }
  }
}

# The error keeps the classes and fields of the original one: code that expects a lost connection
# need not know that it was lost during play.
abort_with_result <- function(cnd, what, result, played, class, call, hint = NULL) {
  own <- c("message", "call", "parent", "trace", "body", "header", "footer", "rlang",
           "use_cli_format")
  fields <- unclass(cnd)[setdiff(names(cnd), own)]
  rlang::exec(
    gym_abort,
    c(
      paste0(what, " ended early, after ", played, "."),
      i = "The field `result` of this condition has the finished part.",
      i = hint
    ),
    class = c(class, grep("^gym_error_", class(cnd), value = TRUE)),
    result = result,
    !!!fields,
    parent = cnd,
    call = call
  )
}
