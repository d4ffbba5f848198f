# The checks of check_env(). Each records its findings in `check`, an environment with `env`,
# `found` (a list of findings), `misfits` (the number of observations that did not fit their space),
# `lengths` (the lengths of the episodes played) and `limit` (the most steps of an episode).

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
  # After different seeds the generator has the same state only if the environment's code sets it.
  for (topic in names(first$states)) {
    if (identical(first$states[[topic]], second$states[[topic]])) {
      note_finding(check, "seeds", paste0(
        "`", topic, "()` sets the state of the random generator, as `set.seed()` does, so that ",
        "every episode draws the same numbers for any seed: remove that call."
      ))
      break
    }
  }
  remembers <- remembering(check$env$spec$wrappers)
  if (length(remembers)) {
    note_finding(check, "seeds", paste0(
      remembers[[1L]], " remembers earlier episodes: later the same seed gives other numbers."
    ), severity = "note")
  } else {
    again <- play_and_look(check, seed, first$actions)
    if (!is.null(again)) look_at_difference(check, first, again, seed)
    look_at_reset_without_seed(check, seed)
  }
  look_at_render(check, seed)
}

#' Check whether an environment plays like its model
#'
#' @param env The environment itself.
#' @param seed Episodes use seeds above it.
#' @noRd
look_at_model <- function(env, check, seed) UseMethod("look_at_model")

#' @exportS3Method
look_at_model.default <- function(env, check, seed) NULL

# Records a kind of finding only once, when it first occurs.
note_finding <- function(check, topic, finding, key = finding, severity = "wrong") {
  key <- paste(topic, key)
  if (is.null(check$found[[key]])) {
    check$found[[key]] <- list(topic = topic, severity = severity, finding = shown_text(finding))
  }
}

# Returns whether the environment can be played at all.
look_at_members <- function(check) {
  # `$` of an environment of this package aborts for a missing element.
  members <- sapply(
    c("observation_space", "action_space", "reset", "step", "spec"),
    function(name) check$env[[name]], simplify = FALSE
  )
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
  if (has_parts(space)) {
    if (!length(space$spaces)) note("`", path, "` is a ", space$name, " without parts.")
    keys <- names(space$spaces)
    for (i in seq_along(space$spaces)) {
      part <- if (is.null(keys)) path_index(path, i - 1L) else path_key(path, keys[[i]])
      look_at_part(check, space$spaces[[i]], part)
    }
  } else if (inherits(space, "gym_space_box")) {
    fixed <- which(space$low == space$high)
    if (length(fixed)) {
      note("Number ", fixed[[1L]], " of `", path, "` can only be ", space$low[fixed[[1L]]], ".")
    }
    if (startsWith(path, "$action") && any(is.infinite(c(space$low, space$high)))) {
      note("The actions of `", path, "` have no bounds: a policy that chooses among them needs ",
           "some.")
    }
  }
}

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
      "ends needs `max_steps`, as in `rollout(env, policy, max_steps = 200)`."
    ), severity = "note")
  }
}

# Seeds ---------------------------------------------------------------------------------

look_at_reset_without_seed <- function(check, seed) {
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

# Records the first difference between two episodes.
look_at_difference <- function(check, first, again, seed) {
  note <- function(what, one, other) {
    # A physics simulation, such as Box2D's, may differ in the last digits.
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
      each <- lapply(list(first, again), function(episode) {
        out <- episode$results[[i]]
        if (is.list(out)) out[[name]] else out
      })
      if (!identical(each[[1L]], each[[2L]])) {
        return(note(paste0("values of `", name, "` in step ", i), each[[1L]], each[[2L]]))
      }
    }
  }
}

# For vectors of numbers, only the first difference.
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
  draws <- if (is_server_env(env)) {
    known_instance(env$client, env$instance_id)$draws
  } else {
    is.function(env[["render"]])
  }
  if (draws && is.null(env[["num_envs"]])) {
    env$reset(seed = seed)
    # Discard plots.
    on_device(grDevices::pdf(NULL), call_and_look(check, "render", "`render()`", env$render()))
  }
}
