# Plays environments written in R as vector environments.

# The default number of sub-environments.
r_sub_envs <- 16L
vectorized_sub_envs <- 256L

#' @export
as_vector_env.gym_r_env <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                    client = NULL, num_workers = NULL) {
  check_made_before(NULL, c(list(...), num_workers = num_workers), x)
  check_count(num_envs, allow_null = TRUE)
  check_one_framed(num_envs, frames)
  check_sub_env_open(sub_env_of(x))
  definition <- definition_of(x)
  if (frames) {
    check_renders(sub_env_of(x))
    num_envs <- 1L
  }
  if (definition$vectorized) {
    return(vectorized_vector_env(definition, as.integer(num_envs %||% vectorized_sub_envs), frames))
  }
  n <- num_envs %||% min(r_sub_envs, max_envs)
  alone <- if (n == 1L) r_env$new(definition)
  sub_envs <- if (is.null(alone)) {
    lapply(seq_len(n), function(i) definition_sub_env(definition))
  } else {
    list(sub_env_of(alone))
  }
  scalar_vector_env(sub_envs, episodes_of_batch(num_envs %||% r_sub_envs), frames, alone)
}

# One function call for each sub-environment and step ----------------------------------

#' Play several sub-environments together
#'
#' @param sub_envs A list of sub-environments, all with the same traits.
#' @param alone The environment that a single sub-environment belongs to; `NULL` for several.
#' @noRd
scalar_vector_env <- function(sub_envs, batch_size, frames, alone) {
  traits <- sub_envs[[1L]]$traits
  all <- seq_along(sub_envs)
  number <- function(i) if (length(sub_envs) > 1L) i
  pick <- action_picker(traits$action_space)
  stack <- result_stacker(traits)
  new_vector_env(
    traits$observation_space, traits$action_space, traits$spec, num_envs = length(sub_envs),
    batch_size = batch_size, one_seed = FALSE, env = alone,
    frame = if (frames) function() sub_env_png(sub_envs[[1L]], NULL),
    step_one = if (!is.null(alone)) single_stepper(sub_envs[[1L]]),
    guard = if (!is.null(alone)) single_guard(sub_envs[[1L]]),
    reset = function(seeds, which = all) {
      call <- rlang::current_env()
      which <- which %||% all
      values <- lapply(seq_along(which), function(k) {
        i <- which[[k]]
        reset_sub_env(sub_envs[[i]], seeds[[k]], sub_env_number = number(i), call = call)
      })
      space <- traits$observation_space
      tidy_value(space, batch_of(space, values), length(which))
    },
    step = function(action, which = all) {
      call <- rlang::current_env()
      which <- which %||% all
      action <- checked_action(traits, action, which, call)
      stepping <- sub_envs[which]
      taken <- vapply(stepping, function(sub_env) sub_env$taken, 0L) + 1L
      if (anyNA(taken)) check_was_reset(stepping[[which.max(is.na(taken))]], call)
      outs <- vector("list", length(which))
      k <- 0L
      session <- globalenv()
      keep_random_state(withCallingHandlers(
        for (k in seq_along(which)) {
          sub_env <- stepping[[k]]
          generator <- sub_env$generator
          # Like with_generator(), but restores the session's state only once, after all steps.
          assign(".Random.seed", generator$state, envir = session)
          outs[k] <- list(sub_env$step(pick(action, k)))
          generator$state <- session$.Random.seed
          sub_env$taken <- taken[[k]]
        },
        error = function(cnd) abort_raised(cnd, stepping[[k]], number(which[[k]]), call)
      ))
      result <- stack(outs) %||% stack_checked(outs, stepping, lapply(which, number), call)
      if (traits$limit < Inf) result$truncated <- result$truncated | taken >= traits$limit
      ended <- result$terminated | result$truncated
      if (any(ended)) for (sub_env in stepping[ended]) sub_env$ended <- TRUE
      result$next_observation <- result$observation
      result
    }
  )
}

#' Make the function that steps a single sub-environment
#'
#' It checks correct results, the usual case, in a fast way, and leaves all others to
#' [complete_step()]. [single_guard()] says in which step the user's functions raised an error. It
#' is set up once for many steps.
#' @return A function of an action that returns a step, as in [as_vector_env()].
#' @noRd
single_stepper <- function(sub_env) {
  traits <- sub_env$traits
  space <- traits$observation_space
  limit <- traits$limit
  size <- if (inherits(space, "gym_space_box") && length(space$shape) == 1L) space$shape[[1L]]
  columns <- if (!is.null(space$names)) list(NULL, space$names)
  session <- globalenv()
  as_batch <- function(observation) {
    if (is.null(size)) {
      return(batch_of(space, list(tidy_value(space, observation, NULL))))
    }
    dim(observation) <- c(1L, size)
    if (!is.null(columns)) dimnames(observation) <- columns
    observation
  }
  function(action) {
    check_was_reset(sub_env, NULL)
    own <- session$.Random.seed
    generator <- sub_env$generator
    assign(".Random.seed", generator$state, envir = session)
    sub_env$stepping <- TRUE
    out <- sub_env$step(action)
    sub_env$stepping <- FALSE
    generator$state <- session$.Random.seed
    assign(".Random.seed", own, envir = session)
    taken <- sub_env$taken + 1L
    sub_env$taken <- taken
    if (!is_right_step(out, traits)) out <- complete_step(out, sub_env, call = NULL)
    list(
      reward = out$reward, terminated = out$terminated,
      truncated = isTRUE(out$truncated) || taken >= limit,
      next_observation = as_batch(out$observation)
    )
  }
}

# A quick check of the usual case: `TRUE` if the result is certainly right.
is_right_step <- function(out, traits) {
  reward <- if (is.list(out)) out$reward
  flag <- out$terminated
  is.double(reward) && length(reward) == 1L && !is.na(reward) && (isTRUE(flag) || isFALSE(flag)) &&
    (is.null(out$truncated) || isTRUE(out$truncated) || isFALSE(out$truncated)) &&
    is.null(out$info) && !is.object(out$observation) &&
    fits_quickly(traits$observation_space, out$observation, NULL, traits$fits_observations)
}

# Adds the environment and the step to an error of the user's function.
single_guard <- function(sub_env) {
  sub_env$stepping <- FALSE
  function(code) {
    withCallingHandlers(code, error = function(cnd) {
      if (sub_env$stepping) {
        sub_env$stepping <- FALSE
        abort_raised(cnd, sub_env, NULL, NULL)
      }
    })
  }
}

#' Make a function that combines the results of the steps of several sub-environments
#'
#' @return A function of a list of results. It returns `NULL` if one of the results may be wrong.
#' @noRd
result_stacker <- function(traits) {
  space <- traits$observation_space
  # Values of other spaces must be checked one by one.
  if (!is_stackable(space)) {
    return(function(outs) NULL)
  }
  shape <- as.integer(space$shape)
  size <- prod(shape)
  # A batch of observations; `NULL` if one of them does not have the shape of the space.
  stack <- function(values, n) {
    shaped <- if (length(shape) > 1L) {
      all(vapply(values, function(value) identical(dim(value), shape), NA))
    } else {
      is.null(unlist(lapply(values, dim))) && all(lengths(values) == size)
    }
    if (!shaped || any(vapply(values, is.object, NA))) {
      return(NULL)
    }
    numbers <- unlist(values, recursive = FALSE, use.names = FALSE)
    if (length(shape) == 0L || !is.atomic(numbers)) {
      return(numbers)
    }
    dim(numbers) <- c(size, n)
    numbers <- t(numbers)
    if (length(shape) > 1L) dim(numbers) <- c(n, shape)
    numbers
  }
  function(outs) {
    n <- length(outs)
    if (!all(vapply(outs, is.list, NA))) {
      return(NULL)
    }
    result <- list(
      reward = stack_singles(outs, "reward"), terminated = stack_singles(outs, "terminated"),
      truncated = stack_singles(outs, "truncated", optional = TRUE)
    )
    observation <- if (is.null(wrong_parts(result, n))) {
      stack(lapply(outs, .subset2, "observation"), n)
    }
    if (!is.null(observation) && traits$fits_observations(observation, n)) {
      result$reward <- as.numeric(result$reward)
      c(list(observation = tidy_value(space, observation, n)), result)
    }
  }
}

# Returns NULL if an element is not a single value. If all results lack an optional element, all
# are FALSE.
stack_singles <- function(outs, name, optional = FALSE) {
  each <- lapply(outs, .subset2, name)
  length_of <- lengths(each)
  if (all(length_of == 1L)) {
    unlist(each, recursive = FALSE, use.names = FALSE)
  } else if (optional && all(length_of == 0L)) {
    logical(length(outs))
  }
}

# Checks each result alone, so that an error names the wrong one.
stack_checked <- function(outs, sub_envs, numbers, call) {
  space <- sub_envs[[1L]]$traits$observation_space
  results <- Map(complete_step, outs, sub_envs, numbers, MoreArgs = list(call = call))
  each <- function(name) lapply(results, `[[`, name)
  list(
    observation = tidy_value(space, batch_of(space, each("observation")), length(outs)),
    reward = unlist(each("reward")), terminated = unlist(each("terminated")),
    truncated = unlist(each("truncated"))
  )
}

# One function call for all sub-environments -------------------------------------------

#' Play a vectorised environment
#'
#' Every step steps all sub-environments. It ignores the results of those whose episode has ended.
#' @noRd
vectorized_vector_env <- function(definition, num_envs, frames = FALSE) {
  sub_env <- definition_sub_env(definition, num_envs)
  traits <- definition$traits
  new_vector_env(
    traits$observation_space, traits$action_space, traits$spec, num_envs = num_envs,
    batch_size = num_envs, one_seed = TRUE,
    frame = if (frames) function() sub_env_png(sub_env, NULL),
    reset = function(seeds, which = NULL) {
      reset_sub_env(sub_env, seeds[[1L]], call = rlang::current_env())
    },
    step = function(action, which = seq_len(num_envs)) {
      call <- rlang::current_env()
      which <- which %||% seq_len(num_envs)
      check_was_reset(sub_env, call)
      action <- checked_action(traits, action, which, call)
      action <- actions_of_all(traits$action_space, action, which, num_envs)
      out <- raw_step(sub_env, action, call)
      some <- length(which) < num_envs
      if (some) out <- without_ended(out, traits$observation_space, which, num_envs)
      out <- complete_step(out, sub_env, call = call)
      out$next_observation <- out$observation
      if (some) rows_of_step(traits$observation_space, out, which) else out
    }
  )
}

# A sub-environment whose episode has ended may return anything. The result of the first running
# one replaces its result.
without_ended <- function(out, space, which, n) {
  if (is.list(out)) {
    row <- rep(which[[1L]], n)
    row[which] <- which
    for (name in c("reward", flags)) {
      if (length(out[[name]]) == n) out[[name]] <- out[[name]][row]
    }
    if (identical(as.integer(batch_length(space, out$observation)), n)) {
      out$observation <- batch_rows(space, out$observation, row)
    }
  }
  out
}
