#' Check an environment
#'
#' Check the spaces, play a few episodes with random actions and check all results, like Gymnasium's
#' `check_env()`. It finds observations outside their space, rewards that are not finite numbers,
#' flags that are not `TRUE` or `FALSE`, seeds that do not reproduce an episode, random numbers from
#' the session's generator, episodes that never end, and frames that cannot be drawn. After a
#' problem it continues if possible.
#'
#' It plays two episodes, with the seeds `seed` and `seed + 1`. It then repeats the first one with
#' the same actions. The results must be the same, bit for bit. It checks all sub-environments of a
#' vector environment together, until the first of them ends.
#'
#' If an environment made by `gym_env(model = )` has no other problem, the check plays about 1000
#' more steps and compares them with the model. The model must allow every starting state, next
#' state, reward and end.
#'
#' @param env The environment: made by [gym_env()] or [gym_make()]; any list or environment with
#'   functions `reset(seed)` and `step(action)`; or an id such as `"CartPole-v1"` (with wrappers,
#'   see [gym_wrap()]). The check resets and steps it. If you give an id, the check makes the
#'   environment and closes it.
#' @param ... Arguments of the environment, by name, if it is given by its id.
#' @param max_steps The number of steps after which an episode counts as endless, a whole number.
#'   The default is 1000. If the environment's own limit is higher, the check uses that limit.
#' @param seed The first seed, a whole number from 0 to 2^53.
#' @param client The client of the server that makes an environment of Gymnasium.
#' @return An object of class `gym_check`, which prints the findings. It is a data frame with a row
#'   for each finding and the columns
#'   \describe{
#'     \item{topic}{The topic, a string: `"spaces"`, `"reset"`, `"step"`, `"seeds"`, `"end"`,
#'       `"render"` or `"model"`.}
#'     \item{severity}{`"wrong"` for a mistake, `"note"` for something that may be intended.}
#'     \item{finding}{The finding, a sentence.}
#'   }
#' @section Errors: `gym_error_argument` for an object that is not an environment. If it makes an
#'   environment, also the errors of [gym_make()]. Problems of the environment are findings, not
#'   errors.
#' @seealso [gym_env()], `vignette("own-environment")`
#' @export
#' @examples
#' # A walk along 5 places, with two mistakes.
#' walk <- list(
#'   observation_space = space_discrete(5), action_space = space_discrete(2),
#'   spec = list(id = "Walk"),
#'   reset = function(seed = NULL) place <<- 0,
#'   step = function(action) {
#'     place <<- place + if (action == 1) 1 else -1
#'     list(observation = place, reward = NA, terminated = place == 4, truncated = FALSE)
#'   }
#' )
#' check_env(walk)
check_env <- function(env, ..., max_steps = 1000, seed = 1, client = gym_client()) {
  match_whole_names()
  check_count(max_steps)
  check_seed(seed, min = 0)
  made <- (is.list(env) || is.environment(env)) && is.null(given_id(env))
  if (made) {
    check_made_before(NULL, list(...), env)
  } else {
    check_environment(env)
    env <- gym_make(env, ..., seed = seed, client = client)
    on.exit(close_quietly(env))
  }
  check <- rlang::env(
    env = env, found = list(), misfits = 0L, lengths = integer(), limit = max_steps,
    in_r = inherits(env, "gym_r_env")
  )
  if (check$in_r) {
    check$env <- without_checks(env)
    # The check leaves the environment in the middle of an episode: require a reset before the next
    # step.
    sub_env <- sub_env_of(env)
    on.exit(sub_env$taken <- NA_integer_, add = TRUE)
  }
  keep_random_state({
    look_at_environment(check, seed)
    look_at_model(env, check, seed + 1)
  })
  column <- function(name) as.character(vapply(check$found, `[[`, "", name))
  spec <- check$env[["spec"]]
  structure(
    data.frame(topic = column("topic"), severity = column("severity"), finding = column("finding")),
    label = environment_label(list(spec = if (is.list(spec)) spec)), lengths = check$lengths,
    class = c("gym_check", "data.frame")
  )
}

#' @export
format.gym_check <- function(x, ...) paste0("<gym_check: ", attr(x, "label"), ">")

#' @export
print.gym_check <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  lengths <- attr(x, "lengths")
  if (length(lengths)) {
    range <- unique(range(lengths))
    cat("  played: ", count_of(length(lengths), "episode"), " of ", paste(range, collapse = " to "),
        " step", if (!identical(range, 1L)) "s", "\n", sep = "")
  }
  for (row in order(x$severity != "wrong")) {
    cat(sitrep_mark(x$severity[[row]]), " ", x$topic[[row]], ": ", x$finding[[row]], "\n", sep = "")
  }
  if (!any(x$severity == "wrong")) cat(sitrep_mark("ok"), " Nothing is wrong.\n", sep = "")
  invisible(x)
}

# Playing: each of these checks the results -------------------------------------------------

# The value of a function that raised an error.
raised <- structure(list(), class = "gym_raised")

has_raised <- function(x) inherits(x, "gym_raised")

# Calls a function of the environment. Records an error, or a change of the session's random
# generator, as a finding.
call_and_look <- function(check, topic, place, code) {
  before <- session_random_state()
  value <- tryCatch(code, error = function(cnd) {
    note_finding(check, topic, error_finding(cnd, place), key = "error")
    raised
  })
  if (!identical(session_random_state(), before)) {
    note_finding(check, "seeds", paste0(
      "`", topic, "()` uses the session's random generator, so the seed does not fix the episode: ",
      "make the environment by `gym_env()`, which gives it its own generator."
    ), key = "session")
  }
  value
}

session_random_state <- function() list(globalenv()$.Random.seed, RNGkind())

# Errors of this package already say what went wrong and where.
error_finding <- function(cnd, place) {
  own <- inherits(cnd, "gym_error")
  text <- paste0(if (!own) paste0(place, " raised an error: "), first_line(cnd))
  parent <- if (own) cnd$parent
  if (is.null(parent)) text else paste0(sub("[.]$", ": ", text), first_line(parent))
}

first_line <- function(cnd) {
  text <- if (rlang::is_condition(cnd) && inherits(cnd, "rlang_error")) {
    rlang::cnd_header(cnd)
  } else {
    conditionMessage(cnd)
  }
  sub("\n.*", "", sub("([^.!?])$", "\\1.", text))
}

#' Play an episode and check the results
#' @param actions The actions, `NULL` to draw them.
#' @return A list of `observation` (the first one), `actions`, `results` (of the steps), `ended`
#'   and `states` (of an R environment's generator); `NULL` if `reset()` failed.
#' @noRd
play_and_look <- function(check, seed, actions = NULL) {
  env <- check$env
  observation <- call_and_look(
    check, "reset", paste0("`reset(seed = ", seed, ")`"), env$reset(seed = seed)
  )
  if (has_raised(observation)) {
    return(NULL)
  }
  look_at_observation(check, "reset", observation, "The first observation")
  # The environment uses the first random stream of the seed, so actions use the next one.
  drawn <- new_generator(stream = parallel::nextRNGStream(seed_stream(seed)))
  episode <- list(
    observation = observation, actions = list(), results = list(), ended = FALSE,
    # The generator is accessible only in an environment written in R.
    states = if (check$in_r) list(reset = env$random_state())
  )
  for (taken in seq_len(if (is.null(actions)) check$limit else length(actions))) {
    action <- actions[[taken]] %||% with_generator(drawn, space_sample(env$action_space))
    place <- paste0("step ", taken, " of the episode with seed ", seed)
    out <- call_and_look(check, "step", paste("`step()` in", place), env$step(action))
    if (has_raised(out)) {
      break
    }
    if (check$in_r && taken == 1L) episode$states$step <- env$random_state()
    look_at_step(check, out, place)
    episode$actions[[taken]] <- action
    episode$results[[taken]] <- out
    if (is.list(out) && any(out$terminated %in% TRUE, out$truncated %in% TRUE)) {
      episode$ended <- TRUE
      break
    }
  }
  check$lengths <- c(check$lengths, length(episode$results))
  episode
}

# To explain why an observation does not fit takes milliseconds, and an episode may have a
# thousand.
most_misfits <- 20L

look_at_observation <- function(check, topic, observation, what) {
  if (check$misfits >= most_misfits) {
    return()
  }
  tryCatch(
    check_value(allow_rounding(check$space), observation, "", NULL, bounds = TRUE),
    gym_error_space = function(cnd) {
      check$misfits <- check$misfits + 1L
      index <- suppressWarnings(as.integer(sub("^\\[([0-9]+)\\]$", "\\1", cnd$path)))
      name <- check$space[["names"]][index + 1L]
      place <- if (nzchar(cnd$path)) {
        paste0(" at `$", sub("^[$]", "", cnd$path), "`",
               if (length(name) && !is.na(name)) paste0(" (", name, ")"))
      }
      problem <- first_line(cnd)
      note_finding(check, topic, paste0(
        what, ", ", describe_value(observation), ", does not fit the space ", format(check$space),
        place, ": ", tolower(substr(problem, 1L, 1L)), substring(problem, 2L)
      ), key = paste("observation", sub("outside.*", "outside", problem)))
    }
  )
}

look_at_step <- function(check, out, place) {
  note <- function(key, ...) note_finding(check, "step", paste0(...), key = key)
  if (!is.list(out)) {
    note("list", "`step()` must return a list, but returned ", describe_argument(out), " in ",
         place, ".")
    return()
  }
  absent <- setdiff(c("observation", "reward", flags), names(out))
  for (name in absent) {
    note(name, "`step()` must return a list with an element `", name, "`, which is missing in ",
         place, ".")
  }
  wrong <- wrong_parts(out, check$env[["num_envs"]] %||% 1L, finite = TRUE)
  for (name in setdiff(names(wrong), absent)) {
    note(name, "`", name, "` must be ", wrong[[name]], ", and is ", describe_argument(out[[name]]),
         " in ", place, ".")
  }
  if (!"observation" %in% absent) {
    look_at_observation(check, "step", out$observation, paste("The observation of", place))
  }
}

# Environments written in R --------------------------------------------------------------

# The environment without its own checks: they raise an error at the first mistake, and
# check_env() continues.
without_checks <- function(env) {
  sub_env <- sub_env_of(env)
  list(
    observation_space = env$observation_space, action_space = env$action_space, spec = env$spec,
    single_observation_space = env$single_observation_space,
    single_action_space = env$single_action_space, num_envs = sub_env$num_envs,
    render = if (!is.null(sub_env$render)) function() draw_sub_env(sub_env, NULL),
    random_state = function() sub_env$generator$state,
    reset = function(seed = NULL) {
      if (!is.null(seed)) sub_env$generator <- new_generator(seed)
      observation <- with_generator(sub_env$generator, sub_env$reset(seed, NULL))
      sub_env$taken <- 0L
      observation
    },
    step = function(action) {
      out <- with_generator(sub_env$generator, sub_env$step(action))
      sub_env$taken <- sub_env$taken + 1L
      if (is.list(out)) {
        truncated <- out$truncated %||% logical(sub_env$num_envs %||% 1L)
        at_limit <- sub_env$taken >= sub_env$traits$limit
        out$truncated <- if (is.logical(truncated)) truncated | at_limit else truncated
      }
      out
    }
  )
}
