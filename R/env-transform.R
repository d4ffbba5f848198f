# Wrappers that call a user's function in each step, named as in Gymnasium. The function gets
# batches; for a single environment, a batch of one. The wrappers go around environments in R and
# environments of a server (env-wrapped-server.R).

# The arguments that the function of each wrapper may have. It changes the first one.
transforms <- list(
  TransformReward = c("reward", "observation", "action", "next_observation", "terminated",
                      "truncated"),
  TransformObservation = "observation", TransformAction = c("action", "observation")
)

wrap_transform_reward <- function(traits, func, call) {
  transform <- new_transform("TransformReward", func, traits, call)
  changed <- traits
  # The threshold is about the original rewards.
  changed$spec["reward_threshold"] <- list(NULL)
  fit <- function(reward, n) {
    wrong <- if (!(is.numeric(reward) || is.logical(reward)) || length(reward) != n) {
      describe_argument(reward)
    } else if (!all(is.finite(reward))) {
      at <- which(!is.finite(reward))[[1L]]
      paste0(reward[[at]], if (n > 1L) paste0(" in row ", at))
    }
    if (!is.null(wrong)) {
      rewards <- if (n > 1L) paste("each of", n, "rewards") else "one reward"
      problem <- paste0("must return a finite number for ", rewards, ", not ", wrong)
      abort_transform(transform, problem, reward)
    }
    as.numeric(reward)
  }
  around <- function(inner, n, next_step) {
    seen <- observation_memory(transform, traits, n)
    # With autoreset_mode "NextStep", the step after the end of an episode only resets: its reward
    # stays as it is.
    ended <- logical(n)
    list(
      reset = function(..., mask = NULL) {
        observation <- inner$reset(..., mask = mask)
        if (next_step) ended[mask %||% TRUE] <<- FALSE
        seen$note(observation)
      },
      step = function(action, which = NULL, ..., finals = TRUE) {
        finals <- finals || transform$asks("next_observation")
        before <- seen$rows(which)
        out <- inner$step(action, which = which, ..., finals = finals)
        seen$note(out$observation, which)
        reward <- transform$ask(list(
          reward = out$reward, observation = before, action = action,
          next_observation = out$next_observation %||% out$observation,
          terminated = out$terminated, truncated = out$truncated
        ), length(out$reward), fit)
        if (next_step) {
          rows <- which %||% seq_len(n)
          reward[ended[rows]] <- out$reward[ended[rows]]
          ended[rows] <<- out$terminated | out$truncated
        }
        out$reward <- reward
        out
      }
    )
  }
  list(traits = changed, around = around_batches(traits, changed, around))
}

wrap_transform_observation <- function(traits, func, observation_space = NULL, call) {
  transform <- new_transform("TransformObservation", func, traits, call)
  changed <- change_spaces(traits, observation_space %||% traits$observation_space, call = call)
  space <- changed$observation_space
  fit <- function(observation, n) {
    check_names_order(transform, space, observation)
    observation <- form_batch(space, observation, n)
    if (!changed$fits_observations(observation, n)) {
      refuse_misfit(transform, changed$observation_rules, observation, n, "observation_space",
                    observation_space)
    }
    tidy_value(space, observation, n)
  }
  change <- function(observation, n) {
    transform$ask(list(observation = observation), n, fit)
  }
  around <- function(inner, n, ...) {
    list(
      reset = function(...) change(inner$reset(...), n),
      step = function(action, ...) {
        out <- inner$step(action, ...)
        observation <- change(out$observation, length(out$reward))
        if (!is.null(out$next_observation)) {
          out <- change_final(out, observation, traits$observation_space, space, change)
        }
        out$observation <- observation
        out
      }
    )
  }
  list(traits = changed, around = around_batches(traits, changed, around))
}

# If the step also started the next episode, the last observation of the previous one must be
# changed separately.
change_final <- function(out, observation, inside, outside, change) {
  final <- out$next_observation
  out$next_observation <- observation
  if (!identical(final, out$observation)) {
    ended <- which(out$terminated | out$truncated)
    last <- change(batch_rows(inside, final, ended), length(ended))
    n <- length(out$reward)
    out$next_observation <- replace_rows(outside, observation, n, ended, last)
    if (!is.null(out$info$final_obs)) {
      out$info$final_obs[ended] <- lapply(seq_along(ended), batch_value, space = outside,
                                          batch = last)
    }
  }
  out
}

wrap_transform_action <- function(traits, func, action_space = NULL, call) {
  changed <- change_spaces(traits, action_space = action_space %||% traits$action_space,
                           call = call)
  transform <- new_transform("TransformAction", func, changed, call)
  inside <- traits$action_space
  fit <- function(action, n) {
    action <- form_batch(inside, action, n)
    if (!traits$fits_actions(action, n)) {
      refuse_misfit(transform, traits$action_rules, action, n, "action_space", action_space)
    }
    tidy_actions(inside, action)
  }
  around <- function(inner, n, ...) {
    seen <- observation_memory(transform, traits, n)
    list(
      reset = function(...) seen$note(inner$reset(...)),
      step = function(action, which = NULL, ...) {
        before <- seen$rows(which)
        count <- if (is.null(which)) n else length(which)
        action <- transform$ask(list(action = action, observation = before), count, fit)
        out <- inner$step(action, which = which, ...)
        seen$note(out$observation, which)
        out
      }
    )
  }
  list(traits = changed, around = around_batches(traits, changed, around))
}

# Keeps the current observation of each sub-environment, if the function asks for it.
observation_memory <- function(transform, traits, n) {
  asked <- transform$asks("observation")
  space <- traits$observation_space
  seen <- NULL
  list(
    note = function(observation, which = NULL) {
      if (asked) {
        some <- !is.null(which)
        seen <<- if (some) replace_rows(space, seen, n, which, observation) else observation
      }
      observation
    },
    rows = function(which) {
      if (asked && is.null(seen)) check_was_reset(list(taken = NA, traits = traits), NULL)
      if (is.null(which) || !asked) seen else batch_rows(space, seen, which)
    }
  )
}

# Functions of batches -------------------------------------------------------------------

#' Make the function that wraps the methods of an environment
#'
#' @param inside,outside The traits of the wrapped environment, and of the result.
#' @param around A function that returns the wrapped functions. Its arguments are `inner`, whose
#'   functions take and return batches; the number of sub-environments; and whether the step after
#'   the end of an episode only resets.
#' @return A function like `around` of `r_wrappers`. Its third argument is an environment of a
#'   server, or `NULL`; the results of a server are already checked.
#' @noRd
around_batches <- function(inside, outside, around) {
  function(inner, num_envs, env = NULL) {
    if (is.null(env)) inner <- checked_functions(inner, inside, num_envs)
    if (!is.null(num_envs)) {
      return(around(inner, num_envs, identical(env$autoreset_mode, "NextStep")))
    }
    of_one <- convert_functions(
      inner, observation = function(value) batch_of(inside$observation_space, list(value)),
      action = function(batch) batch_value(inside$action_space, batch, 1L)
    )
    convert_functions(
      around(of_one, 1L, FALSE),
      observation = function(batch) batch_value(outside$observation_space, batch, 1L),
      action = function(value) batch_of(outside$action_space, list(value))
    )
  }
}

convert_functions <- function(inner, observation, action) {
  force(inner)
  list(
    reset = function(...) observation(inner$reset(...)),
    step = function(given, ...) {
      out <- inner$step(action(given), ...)
      out$observation <- observation(out$observation)
      out
    }
  )
}

# The user's function --------------------------------------------------------------------

#' Prepare the function of a wrapper
#'
#' @return A list: `wrapper`, its name; `asks(part)`, whether the function needs this part; and
#'   `ask(parts, n, fit)`, which calls the function with a list of batches of `n` rows, and returns
#'   `fit(result, n)`.
#' @noRd
new_transform <- function(wrapper, func, traits, call) {
  asked <- asked_parts(wrapper, func, call)
  asking <- as.call(c(list(func), lapply(asked, as.name)))
  transform <- list(wrapper = wrapper, func = func, asks = function(part) part %in% asked)
  answer <- function(parts, n, fit) {
    value <- tryCatch(eval(asking, parts, baseenv()), error = function(cnd) {
      abort_transform(
        transform, paste0("raised an error", if (n == 1L) " for a batch of one row"),
        class = c(own_classes(cnd), "gym_error_environment"), parent = cnd
      )
    })
    fit(value, n)
  }
  space <- traits$observation_space
  rows <- if ("observation" %in% asked && length(space$shape) == 1L) {
    name <- if (is.null(space$names)) 1L else paste0("\"", space$names[[1L]], "\"")
    paste0(": `observation[, ", name, "]` has a number for each, `observation[1]` only one")
  }
  transform$hint <- paste0("It gets a batch, with a row for each sub-environment", rows,
                           "; `ifelse()` chooses for each, `if` cannot.")
  calls <- 0
  compared_at <- 2^(0:10)
  transform$ask <- function(parts, n, fit) {
    if (n > 1L) calls <<- calls + 1
    compares <- n > 1L && calls %in% compared_at
    before <- if (compares) session_random_state()
    value <- answer(parts, n, fit)
    # A function that draws random numbers cannot be compared: it would draw others for one row.
    if (compares && identical(session_random_state(), before)) {
      last_row <- function(part, name) {
        space <- switch(sub("next_", "", name), action = traits$action_space,
                        observation = traits$observation_space)
        if (is.null(space)) part[[n]] else batch_rows(space, part, n)
      }
      alone <- answer(Map(last_row, parts[asked], asked), 1L, fit)
      if (differs_alone(transform, value, alone, n)) compared_at <<- NULL
    }
    value
  }
  transform
}

#' Find the parts that a function needs
#' @return The names of the parts, named by the arguments that get them. If the function has only
#'   one argument, this may have any name, and gets the part that the wrapper changes.
#' @noRd
asked_parts <- function(wrapper, func, call) {
  known <- transforms[[wrapper]]
  if (!is.function(func)) {
    must <- paste0("a function of `", known[[1L]], "`")
    abort_argument(func, must, "func", call)
  }
  declared <- formals(args(func))
  names <- names(declared)
  asked <- intersect(names, known)
  needed <- setdiff(names[vapply(declared, is_without_default, NA)], c(known, "..."))
  if (!length(asked)) {
    # An abbreviation such as `obs` may mean another part: it is an error.
    stands_for_other <- length(needed) == 1L && any(startsWith(known[-1L], needed))
    if (!stands_for_other && (length(needed) == 1L || !length(needed) && length(names))) {
      return(known[[1L]])
    }
  }
  if (length(needed) || !length(asked)) {
    problem <- if (length(needed)) paste0("needs `", needed[[1L]], "`") else "has no argument"
    abort_wrong("func", func, call,
                "`func` of {wrapper} must be a function of `{known[[1L]]}`, and this one
                 {problem}.",
                i = "The names of its arguments can be {quoted_names(known)}.")
  }
  stats::setNames(asked, asked)
}

# Warns if a row alone gives another value than among others. A function that uses `observation[1]`
# as if there were one row would return wrong numbers without an error.
differs_alone <- function(transform, value, alone, n) {
  numbers <- function(x) unlist(x, use.names = FALSE)
  among <- numbers(if (is.list(value)) lapply(value, rows_of, n) else rows_of(value, n))
  differs <- !isTRUE(all.equal(among, numbers(alone)))
  if (differs) {
    values <- c(describe_value(numbers(alone)), describe_value(among))
    rlang::warn(
      c(paste0("`func` of ", transform$wrapper, " gives a row another value when it is alone (",
               values[[1L]], ") than among others (", values[[2L]], ")."), i = transform$hint),
      class = "gym_warning_wrapper", call = NULL
    )
  }
  differs
}

# Converts the result of a function to a batch.
form_batch <- function(space, value, n) {
  value <- as_batch(space, value)
  # The user may have selected one row of a matrix without `drop = FALSE`.
  if (n == 1L && is_stackable(space) && is.null(dim(value)) && length(space$shape) == 1L &&
        length(value) == space$shape) {
    dim(value) <- c(1L, length(value))
  }
  value
}

# Errors about what a function returns --------------------------------------------------

# If the function changes the order of the columns, they would get wrong names.
check_names_order <- function(transform, space, observation) {
  given <- colnames(observation) %||% names(observation)
  if (!is.null(given) && setequal(given, space$names) && !identical(given, space$names)) {
    problem <- paste0("returned ", few_names(given), " for observations with the numbers ",
                      few_names(space$names))
    abort_transform(transform, problem, observation,
                    fix = "If their order is to change, give the new `observation_space`.")
  }
}

refuse_misfit <- function(transform, space, value, n, arg, given) {
  tryCatch(
    check_batch(space, batch_space(space, n), value, n, NULL, bounds = TRUE),
    gym_error_space = function(cnd) {
      problem <- paste0(
        "must return ", count_of(n, sub("_space", "", arg)), " of ", format(space), ", not ",
        describe_argument(value), ": ", sub("[.]$", "", first_line(cnd))
      )
      fix <- if (arg == "observation_space" && is.null(given)) {
        "If it changes the space of observations, give the new one as `observation_space`."
      }
      abort_transform(transform, problem, value, "gym_error_space", fix, parent = cnd)
    }
  )
}

abort_transform <- function(transform, problem, value = NULL, class = "gym_error_argument",
                            fix = NULL, ...) {
  gym_abort(
    c(paste0("`func` of ", transform$wrapper, " ", problem, "."), i = fix, i = transform$hint),
    class = c("gym_error_wrapper", class), wrapper = transform$wrapper, argument = "func",
    value = value, ..., call = NULL
  )
}
