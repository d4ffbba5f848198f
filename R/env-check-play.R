# check_env() plays an environment with these functions and checks all results.

# The value of a function that raised an error.
raised <- structure(list(), class = "gym_raised")

has_raised <- function(x) inherits(x, "gym_raised")

# Calls a function of the environment. An error is a finding, and so is a change of the session's
# random generator.
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
#' @return A list of `observations`, `actions`, `results` (of the steps) and `ended`; `NULL` if it
#'   could not start.
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
  # The environment draws from the first stream of the seed.
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
    if (check$in_r && taken == 1L) {
      episode$states$step <- env$random_state()
    }
    look_at_step(check, out, place)
    episode$actions[[taken]] <- action
    episode$results[[taken]] <- out
    if (has_ended(out)) {
      episode$ended <- TRUE
      break
    }
  }
  check$lengths <- c(check$lengths, length(episode$results))
  episode
}

has_ended <- function(out) {
  is.list(out) && (any(out$terminated %in% TRUE) || any(out$truncated %in% TRUE))
}

# Explaining a misfit takes milliseconds, and an episode may have a thousand of them.
most_misfits <- 20L

look_at_observation <- function(check, topic, observation, what) {
  if (check$misfits >= most_misfits) {
    return()
  }
  problem <- tryCatch(
    {
      check_value(allow_rounding(check$space), observation, "", NULL, bounds = TRUE)
      NULL
    },
    gym_error_space = function(cnd) cnd
  )
  if (!is.null(problem)) {
    check$misfits <- check$misfits + 1L
    place <- if (nzchar(problem$path)) {
      paste0(" at `$", sub("^[$]", "", problem$path), "`",
             name_of_number(check$space, problem$path))
    }
    note_finding(check, topic, paste0(
      what, ", ", describe_value(observation), ", does not fit the space ", format(check$space),
      place, ": ", lower_first(first_line(problem))
    ), key = paste("observation", sub("outside.*", "outside", first_line(problem))))
  }
}

# The name of the number with this index, if the numbers of a Box have names.
name_of_number <- function(space, path) {
  index <- suppressWarnings(as.integer(sub("^\\[([0-9]+)\\]$", "\\1", path)))
  name <- space[["names"]][index + 1L]
  if (length(name) && !is.na(name)) paste0(" (", name, ")")
}

lower_first <- function(text) paste0(tolower(substr(text, 1L, 1L)), substring(text, 2L))

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

# The environment without its own checks, which end an episode at the first mistake.
without_checks <- function(env) {
  sub_env <- sub_env_of(env)
  c(
    list(
      observation_space = env$observation_space, action_space = env$action_space, spec = env$spec,
      single_observation_space = env$single_observation_space,
      single_action_space = env$single_action_space, num_envs = sub_env$num_envs,
      render = if (!is.null(sub_env$render)) function() draw_sub_env(sub_env, NULL),
      random_state = function() sub_env$generator$state
    ),
    unchecked_functions(sub_env)
  )
}

unchecked_functions <- function(sub_env) {
  n <- sub_env$num_envs %||% 1L
  list(
    reset = function(seed = NULL) {
      if (!is.null(seed)) {
        sub_env$generator <- new_generator(seed)
      }
      observation <- with_generator(sub_env$generator, sub_env$reset(seed, NULL))
      sub_env$taken <- 0L
      observation
    },
    step = function(action) {
      out <- with_generator(sub_env$generator, sub_env$step(action))
      sub_env$taken <- sub_env$taken + 1L
      if (is.list(out)) {
        truncated <- out$truncated %||% logical(n)
        at_limit <- sub_env$taken >= sub_env$traits$limit
        out$truncated <- if (is.logical(truncated)) truncated | at_limit else truncated
      }
      out
    }
  )
}
