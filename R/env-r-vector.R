# Environments written in R as vector environments, in which episodes are played.

# How many sub-environments there are where nobody chose.
r_sub_envs <- 16L
vectorized_sub_envs <- 256L

#' @export
as_vector_env.gym_r_env <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                    client = NULL, num_workers = NULL) {
  check_made_before(NULL, c(list(...), num_workers = num_workers), x)
  check_count(num_envs, allow_null = TRUE)
  check_one_framed(num_envs, frames)
  sub_env <- sub_env_of(x)
  check_sub_env_open(sub_env)
  if (frames) {
    check_renders(sub_env)
    num_envs <- 1L
  }
  definition <- definition_of(x)
  if (is.null(definition)) {
    check_only_one(num_envs, sub_env)
    scalar_vector_env(list(sub_env), 1L, frames)
  } else if (definition$vectorized) {
    vectorized_vector_env(definition, as.integer(num_envs %||% vectorized_sub_envs), frames)
  } else {
    if (length(remembering(sub_env$task$spec$wrappers))) {
      num_envs <- 1L
    }
    copies <- lapply(seq_len(num_envs %||% min(r_sub_envs, max_envs)), function(i) {
      definition_sub_env(definition)
    })
    scalar_vector_env(copies, episodes_of_batch(num_envs %||% r_sub_envs), frames)
  }
}

check_only_one <- function(num_envs, sub_env, call = rlang::caller_env()) {
  if (isTRUE(num_envs > 1)) {
    gym_abort(
      c(paste0("`num_envs = ", num_envs, "` takes as many environments, and this ",
               sub_env$task$spec$id, " is one."),
        i = "`gym_register()` its class, and name the environment by its id."),
      class = "gym_error_argument", argument = "num_envs", value = num_envs, call = call
    )
  }
}

new_r_vector_env <- function(task, ..., frames, sub_env) {
  structure(
    list(
      observation_space = task$observation_space, action_space = task$action_space,
      spec = task$spec, ...,
      frame = if (frames) function() sub_env_png(sub_env),
      remembers = remembering(task$spec$wrappers), client = NULL,
      close = function(wait = TRUE) invisible()
    ),
    class = "gym_vector_env"
  )
}

# One function call for each sub-environment and step ----------------------------------

#' Play sub-environments side by side
#'
#' @param sub_envs A list of them, all of one task.
#' @noRd
scalar_vector_env <- function(sub_envs, batch_size, frames = FALSE) {
  task <- sub_envs[[1L]]$task
  all <- seq_along(sub_envs)
  number <- function(i) if (length(sub_envs) > 1L) i
  pick <- action_picker(task$action_space)
  stack <- result_stacker(task)
  new_r_vector_env(
    task, num_envs = length(sub_envs), batch_size = batch_size, one_seed = FALSE,
    env = if (length(sub_envs) == 1L) checked_methods(sub_envs[[1L]]),
    reset = function(seeds, which = all) {
      call <- rlang::current_env()
      which <- which %||% all
      values <- lapply(seq_along(which), function(k) {
        i <- which[[k]]
        reset_sub_env(sub_envs[[i]], seeds[[k]], sub_env_number = number(i), call = call)
      })
      tidy_batch(task$observation_space, batch_of(task$observation_space, values))
    },
    step = function(action, which = all) {
      call <- rlang::current_env()
      which <- which %||% all
      check_actions(task, action, which, call)
      action <- tidy_actions(task$action_space, action)
      stepping <- sub_envs[which]
      taken <- vapply(stepping, function(sub_env) sub_env$taken, 0L) + 1L
      if (anyNA(taken)) {
        check_was_reset(stepping[[which.max(is.na(taken))]], call)
      }
      outs <- vector("list", length(which))
      k <- 0L
      session <- globalenv()
      keep_random_state(withCallingHandlers(
        for (k in seq_along(which)) {
          sub_env <- stepping[[k]]
          generator <- sub_env$generator
          # As with_generator(), but the session's state is put back once for all.
          assign(".Random.seed", generator$state, envir = session)
          outs[k] <- list(sub_env$step(pick(action, k)))
          generator$state <- session$.Random.seed
          sub_env$taken <- taken[[k]]
        },
        error = function(cnd) abort_raised(cnd, stepping[[k]], number(which[[k]]), call)
      ))
      result <- stack(outs) %||% stack_checked(outs, stepping, lapply(which, number), call)
      if (task$limit < Inf) {
        result$truncated <- result$truncated | taken >= task$limit
      }
      ended <- result$terminated | result$truncated
      if (any(ended)) {
        for (sub_env in stepping[ended]) sub_env$ended <- TRUE
      }
      result$next_observation <- result$observation
      result
    },
    frames = frames, sub_env = sub_envs[[1L]]
  )
}

#' Make a function that puts together what the steps of several sub-environments returned
#'
#' @return A function of a list of results. It returns `NULL` where one of them may be wrong.
#' @noRd
result_stacker <- function(task) {
  space <- task$observation_space
  stack <- observation_stacker(space)
  if (is.null(stack)) {
    return(function(outs) NULL)
  }
  function(outs) {
    n <- length(outs)
    if (!all(vapply(outs, is.list, NA))) {
      return(NULL)
    }
    reward <- stack_singles(outs, "reward")
    terminated <- stack_singles(outs, "terminated")
    truncated <- stack_singles(outs, "truncated", optional = TRUE)
    good <- is_reward(reward, n) && is_flags(terminated, n) && is_flags(truncated, n)
    observation <- if (good) stack(lapply(outs, .subset2, "observation"), n)
    if (!is.null(observation) && task$fits_observations(observation, n)) {
      list(
        observation = tidy_batch(space, observation),
        reward = as.numeric(reward), terminated = terminated, truncated = truncated
      )
    }
  }
}

# NULL where one of them is not single. Where all lack what is optional all are FALSE.
stack_singles <- function(outs, name, optional = FALSE) {
  each <- lapply(outs, .subset2, name)
  length_of <- lengths(each)
  if (all(length_of == 1L)) {
    unlist(each, recursive = FALSE, use.names = FALSE)
  } else if (optional && all(length_of == 0L)) {
    logical(length(outs))
  }
}

# NULL for spaces whose values have to be looked at one by one.
observation_stacker <- function(space) {
  if (!is_stackable(space)) {
    return(NULL)
  }
  shape <- as.integer(space$shape)
  size <- prod(shape)
  has_shape <- if (length(shape) > 1L) {
    function(values) all(vapply(values, function(value) identical(dim(value), shape), NA))
  } else {
    function(values) is.null(unlist(lapply(values, dim))) && all(lengths(values) == size)
  }
  function(values, n) {
    if (any(vapply(values, is.object, NA)) || !has_shape(values)) {
      return(NULL)
    }
    numbers <- unlist(values, recursive = FALSE, use.names = FALSE)
    if (length(shape) == 0L || !is.atomic(numbers)) {
      return(numbers)
    }
    dim(numbers) <- c(size, n)
    numbers <- t(numbers)
    if (length(shape) > 1L) {
      dim(numbers) <- c(n, shape)
    }
    numbers
  }
}

# The same with a look at each of them, which finds the one that is wrong.
stack_checked <- function(outs, sub_envs, numbers, call) {
  task <- sub_envs[[1L]]$task
  results <- Map(complete_step, outs, sub_envs, numbers, MoreArgs = list(call = call))
  values <- lapply(results, function(result) result$observation)
  each <- function(name, type) vapply(results, function(result) result[[name]], type)
  list(
    observation = tidy_batch(task$observation_space, batch_of(task$observation_space, values)),
    reward = each("reward", 0), terminated = each("terminated", NA),
    truncated = each("truncated", NA)
  )
}

# One function call for all ------------------------------------------------------------

#' Play a vectorised environment
#'
#' All sub-environments are always stepped, also those whose episode has ended; what these return is
#' left out.
#' @noRd
vectorized_vector_env <- function(definition, num_envs, frames = FALSE) {
  sub_env <- definition_sub_env(definition, num_envs)
  task <- definition$task
  observed <- task$observation_space
  new_r_vector_env(
    task, num_envs = num_envs, batch_size = num_envs, one_seed = TRUE,
    reset = function(seeds, which = NULL) {
      reset_sub_env(sub_env, seeds[[1L]], call = rlang::current_env())
    },
    step = function(action, which = seq_len(num_envs)) {
      call <- rlang::current_env()
      which <- which %||% seq_len(num_envs)
      check_actions(task, action, which, call)
      action <- tidy_actions(task$action_space, action)
      action <- actions_of_all(task$action_space, action, which, num_envs)
      out <- raw_step(sub_env, action, call = call)
      result <- take_rows(out, sub_env, which, call)
      result$next_observation <- result$observation
      result
    },
    frames = frames, sub_env = sub_env
  )
}

#' Take the results of some sub-environments out of what a vectorised step returned, and check them
#' @noRd
take_rows <- function(out, sub_env, which, call) {
  task <- sub_env$task
  space <- task$observation_space
  n <- sub_env$num_envs
  where <- step_place(sub_env)
  if (length(which) < n) {
    out <- rows_of_result(out, sub_env, which, where, call)
  }
  n <- length(which)
  quick <- is.list(out) && is_reward(out$reward, n) && is_flags(out$terminated, n) &&
    (is.null(out$truncated) || is_flags(out$truncated, n))
  if (!quick) {
    check_step_parts(out, n, where, call)
  }
  check_observations(task, out$observation, which, where, call)
  list(
    observation = tidy_batch(space, out$observation),
    reward = as.numeric(out$reward),
    terminated = out$terminated,
    truncated = (out$truncated %||% logical(n)) | sub_env$taken >= task$limit
  )
}

# What those return whose episode has ended may be anything.
rows_of_result <- function(out, sub_env, which, where, call) {
  space <- sub_env$task$observation_space
  n <- sub_env$num_envs
  parts <- c("reward", "terminated", if (is.list(out) && !is.null(out$truncated)) "truncated")
  complete <- is.list(out) && all(lengths(out[parts]) == n)
  if (!complete) {
    check_step_parts(out, n, where, call)
  }
  if (!identical(as.integer(batch_length(space, out$observation)), n)) {
    check_observations(sub_env$task, out$observation, seq_len(n), where, call)
  }
  out[parts] <- lapply(out[parts], `[`, which)
  out$observation <- batch_rows(space, out$observation, which)
  out
}
