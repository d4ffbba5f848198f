# What check_env() looks at. Each look notes what it finds in `check`, an environment with `env`,
# `found` (a list of findings), `lengths` (of the episodes played) and `limit` (the steps that an
# episode may take).

look_at_environment <- function(check, seed) {
  if (!look_at_members(check)) {
    return()
  }
  check$space <- check$env$observation_space
  check$limit <- max(check$limit, check$env$spec$max_episode_steps)
  look_at_space(check, "observation")
  look_at_space(check, "action")
  first <- play_and_look(check, seed)
  if (is.null(first)) {
    return()
  }
  second <- play_and_look(check, seed + 1)
  look_at_end(check, list(first, second))
  remembers <- intersect(check$env$spec$wrappers, remembering_wrappers)
  if (length(remembers)) {
    note_finding(check, "seeds", paste0(
      remembers[[1L]], " remembers earlier episodes: the same seed gives other numbers later."
    ), severity = "note")
  } else {
    look_at_repetition(check, first, seed)
    look_at_reset_without_seed(check, seed)
  }
  look_at_render(check, seed)
}

# The same kind of finding is noted once, where it is first found.
note_finding <- function(check, topic, finding, key = finding, severity = "wrong") {
  key <- paste(topic, key)
  if (is.null(check$found[[key]])) {
    check$found[[key]] <- list(topic = topic, severity = severity, finding = shown_text(finding))
  }
}

# The elements of something that may be no environment of this package's: `$` of one aborts where
# an element is missing.
members_of <- function(env) {
  names <- c("observation_space", "action_space", "reset", "step", "spec")
  stats::setNames(lapply(names, function(name) env[[name]]), names)
}

# Returns whether the environment can be played at all.
look_at_members <- function(check) {
  members <- members_of(check$env)
  for (name in c("reset", "step")) {
    if (!is.function(members[[name]])) {
      note_finding(check, name, paste0("The environment has no function `", name, "()`."))
    }
  }
  for (name in c("observation_space", "action_space")) {
    if (!inherits(members[[name]], "gym_space")) {
      note_finding(check, "spaces", paste0(
        "`", name, "` must be a space, such as `space_discrete(2)`, not ",
        describe_argument(members[[name]]), "."
      ))
    }
  }
  if (!is.list(members$spec) || !rlang::is_string(members$spec$id)) {
    note_finding(check, "spaces", paste0(
      "`spec` must be a list with the environment's name, such as `list(id = \"Walk\")`, not ",
      describe_argument(members$spec), "."
    ))
  }
  !length(check$found)
}

# Spaces --------------------------------------------------------------------------------

look_at_space <- function(check, kind) {
  element <- paste0(kind, "_space")
  look_at_part(check, check$env[[paste0("single_", element)]] %||% check$env[[element]],
               paste0("$", element))
}

look_at_part <- function(check, space, path) {
  note <- function(...) note_finding(check, "spaces", paste0(...), severity = "note")
  if (inherits(space, "gym_space_undescribed")) {
    note("Of `", path, "` the server tells no more than its name, ", space$name, ".")
  } else if (has_parts(space)) {
    if (!length(space$spaces)) {
      note("`", path, "` is a ", space$name, " without parts.")
    }
    keys <- names(space$spaces)
    for (i in seq_along(space$spaces)) {
      part <- if (is.null(keys)) path_index(path, i - 1L) else path_key(path, keys[[i]])
      look_at_part(check, space$spaces[[i]], part)
    }
  } else if (inherits(space, "gym_space_box")) {
    look_at_box(space, path, note)
  }
}

look_at_box <- function(space, path, note) {
  fixed <- which(space$low == space$high)
  if (length(fixed)) {
    note("Number ", fixed[[1L]], " of `", path, "` can only be ", space$low[fixed[[1L]]], ".")
  }
  if (startsWith(path, "$action") && any(is.infinite(c(space$low, space$high)))) {
    note("The actions of `", path, "` have no bounds: a policy that chooses among them needs some.")
  }
}

# Playing -------------------------------------------------------------------------------

# Stands for the value of a function that raised an error.
raised <- structure(list(), class = "gym_raised")

has_raised <- function(x) inherits(x, "gym_raised")

# Calls a function of the environment's. An error is a finding, and so is a session's generator
# that was moved.
call_and_look <- function(check, topic, place, code) {
  before <- session_random_state()
  value <- tryCatch(code, error = function(cnd) {
    note_finding(check, topic, error_finding(cnd, place), key = "error")
    raised
  })
  if (!identical(session_random_state(), before)) {
    note_finding(check, "seeds", paste0(
      "`", topic, "()` moves the session's random generator, so that the seed of an episode does ",
      "not fix it: in an environment made by `gym_env()` it would draw from a generator of its own."
    ), key = "session")
  }
  value
}

session_random_state <- function() list(globalenv()$.Random.seed, RNGkind())

# The errors of this package say themselves what went wrong and where.
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

#' Play an episode and look at what comes back
#' @param actions The actions, `NULL` to draw them.
#' @return A list of `observations`, `actions`, `results` (what the steps returned) and `ended`;
#'   `NULL` where it could not begin.
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
  drawn <- new_generator(seed)
  episode <- list(observation = observation, actions = list(), results = list(), ended = FALSE)
  for (taken in seq_len(if (is.null(actions)) check$limit else length(actions))) {
    action <- actions[[taken]] %||% with_generator(drawn, space_sample(env$action_space))
    place <- paste0("step ", taken, " of the episode with seed ", seed)
    out <- call_and_look(check, "step", paste("`step()` in", place), env$step(action))
    if (has_raised(out)) {
      break
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

look_at_observation <- function(check, topic, observation, what) {
  problem <- tryCatch(
    {
      check_value(check$space, observation, "", NULL, bounds = TRUE)
      NULL
    },
    gym_error_space = function(cnd) cnd
  )
  if (!is.null(problem)) {
    place <- if (nzchar(problem$path)) paste0(" at `$", sub("^[$]", "", problem$path), "`")
    note_finding(check, topic, paste0(
      what, ", ", describe_value(observation), ", does not fit the space ", format(check$space),
      place, ": ", lower_first(first_line(problem))
    ), key = paste("observation", first_line(problem)))
  }
}

lower_first <- function(text) paste0(tolower(substr(text, 1L, 1L)), substring(text, 2L))

look_at_step <- function(check, out, place) {
  note <- function(key, ...) note_finding(check, "step", paste0(...), key = key)
  if (!is.list(out)) {
    note("list", "`step()` must return a list, and returned ", describe_argument(out), " in ",
         place, ".")
    return()
  }
  absent <- setdiff(c("observation", "reward", flags), names(out))
  for (name in absent) {
    note(name, "`step()` must return a list with an element `", name, "`, and in ", place,
         " there is none.")
  }
  n <- check$env[["num_envs"]] %||% 1L
  rules <- list(
    reward = list(are_rewards, "one finite number"), terminated = list(are_flags, "TRUE or FALSE"),
    truncated = list(are_flags, "TRUE or FALSE"),
    info = list(function(x, n) is.null(x) || is.list(x), "a list")
  )
  for (name in setdiff(names(rules), absent)) {
    if (!rules[[name]][[1L]](out[[name]], n)) {
      note(name, "`", name, "` must be ", rules[[name]][[2L]],
           if (n > 1L && name != "info") " for each sub-environment", ", and is ",
           describe_argument(out[[name]]), " in ", place, ".")
    }
  }
  if (!"observation" %in% absent) {
    look_at_observation(check, "step", out$observation, paste("The observation of", place))
  }
}

are_rewards <- function(x, n) is.numeric(x) && length(x) == n && all(is.finite(x))

are_flags <- function(x, n) is.logical(x) && length(x) == n && !anyNA(x)

# The end -------------------------------------------------------------------------------

look_at_end <- function(check, episodes) {
  limit <- check$env$spec$max_episode_steps
  lengths <- vapply(episodes, function(episode) length(episode$results), 0L)
  ended <- vapply(episodes, function(episode) episode$ended, NA)
  if (!is.null(limit) && any(lengths > limit | lengths == limit & !ended)) {
    note_finding(check, "end", paste0(
      "`spec$max_episode_steps` is ", limit, ", but step ", limit, " of an episode was not ",
      "truncated."
    ))
  } else if (all(!ended & lengths == check$limit)) {
    note_finding(check, "end", paste0(
      "No episode ended within ", count_of(check$limit, "step"), ": an environment that never ",
      "ends is played with `max_steps`, as in `rollout(env, policy, max_steps = 200)`."
    ), severity = "note")
  }
}

# A step after the end may be an error or have any result, but the next episode must not depend on
# it.
look_beyond_end <- function(check, episode, seed) {
  if (!episode$ended) {
    return()
  }
  env <- check$env
  action <- episode$actions[[length(episode$actions)]]
  tryCatch(suppressWarnings(env$step(action)), error = function(cnd) NULL)
  place <- paste0("`reset(seed = ", seed, ")` after a step beyond the end of an episode")
  again <- call_and_look(check, "reset", place, env$reset(seed = seed))
  if (!has_raised(again) && !identical(again, episode$observation) && !is_noted(check, "seeds")) {
    note_finding(check, "end", paste0(
      place, " gives another first observation than before: ",
      difference_text(again, episode$observation), "."
    ))
  }
}

is_noted <- function(check, topic) {
  any(vapply(check$found, function(finding) finding$topic == topic, NA))
}

# Seeds ---------------------------------------------------------------------------------

look_at_repetition <- function(check, first, seed) {
  again <- play_and_look(check, seed, first$actions)
  if (!is.null(again)) {
    look_at_difference(check, first, again, seed)
    look_beyond_end(check, again, seed)
  }
}

look_at_reset_without_seed <- function(check, seed) {
  # The seed that an environment was made with may be that of its first `reset()` without one.
  call_and_look(check, "reset", "`reset()` without a seed", check$env$reset())
  following <- lapply(1:2, function(time) {
    check$env$reset(seed = seed)
    call_and_look(check, "reset", "`reset()` without a seed", check$env$reset())
  })
  if (!any(vapply(following, has_raised, NA)) && !identical(following[[1L]], following[[2L]])) {
    note_finding(check, "seeds", paste0(
      "`reset(seed = ", seed, ")` followed by `reset()` gave different first observations: ",
      difference_text(following[[1L]], following[[2L]]), "."
    ), key = "difference")
  }
}

# Notes the first difference between two episodes.
look_at_difference <- function(check, first, again, seed) {
  note <- function(what, one, other) {
    # A simulation of contacts, such as Box2D's, may differ in the last digits.
    close <- isTRUE(all.equal(one, other, tolerance = 1e-5, scale = 1))
    note_finding(check, "seeds", paste0(
      "The same seed, ", seed, ", and the same actions gave different ", what, ": ",
      difference_text(one, other), "."
    ), key = "difference", severity = if (close) "note" else "wrong")
  }
  if (!identical(first$observation, again$observation)) {
    return(note("first observations", first$observation, again$observation))
  }
  for (i in seq_len(min(length(first$results), length(again$results)))) {
    for (name in c("observation", "reward", flags, "info")) {
      one <- element_of(first$results[[i]], name)
      other <- element_of(again$results[[i]], name)
      if (!identical(one, other)) {
        return(note(paste0("values of `", name, "` in step ", i), one, other))
      }
    }
  }
}

element_of <- function(out, name) if (is.list(out)) out[[name]] else out

# Of numbers it shows the first that differs.
difference_text <- function(one, other) {
  if (is.numeric(one) && is.numeric(other) && length(one) == length(other)) {
    at <- which(!mapply(identical, as.vector(one), as.vector(other)))[1L]
    if (!is.na(at)) {
      place <- if (length(one) > 1L) paste0(" for number ", at)
      return(paste0(format(one[[at]], digits = 15L), " and ", format(other[[at]], digits = 15L),
                    place))
    }
  }
  paste(describe_value(one), "and", describe_value(other))
}

# Render --------------------------------------------------------------------------------

look_at_render <- function(check, seed) {
  env <- check$env
  if (!is.null(env[["num_envs"]]) || !can_be_drawn(env)) {
    return()
  }
  env$reset(seed = seed)
  # What is plotted goes nowhere.
  before <- grDevices::dev.cur()
  grDevices::pdf(NULL)
  device <- grDevices::dev.cur()
  on.exit({
    grDevices::dev.off(device)
    if (before > 1L) grDevices::dev.set(before)
  })
  call_and_look(check, "render", "`render()`", env$render())
}

can_be_drawn <- function(env) {
  if (inherits(env, "gym_server_env")) {
    known_instance(env$client, env$instance_id)$draws
  } else if (inherits(env, "gym_r_env")) {
    !is.null(sub_env_of(env)$render)
  } else {
    is.function(env[["render"]])
  }
}
