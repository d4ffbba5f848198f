# Wrappers of environments written in R, with Gymnasium's names, arguments and formulas
# (https://gymnasium.farama.org/api/wrappers/).
#
# A wrapper is made by a function of the traits of the wrapped environment and of its arguments. It
# returns a list: `traits`, those of the result, and `around`, a function of `inner` (a list of the
# functions `reset` and `step` of a sub-environment) and `num_envs` (`NULL` if not vectorised),
# which returns the wrapped functions. It is called for each sub-environment, so each has its own
# state.

#' Wrap an environment written in R
#' @param arguments The wrapper's arguments, a list with names.
#' @return A new environment with the same functions.
#' @noRd
wrap_r_env <- function(env, wrapper, arguments, call) {
  if (!inherits(env, "gym_r_env")) {
    must <- paste("the id of an environment, or one made by `gym_make()`, by `gym_env()` or of a",
                  "class that inherits from `GymEnv`")
    abort_argument(env, must, "env_id", call)
  }
  sub_env <- sub_env_of(env)
  made <- make_r_wrapper(sub_env$traits, wrapper, arguments, call)
  made$traits$spec$wrappers <- c(made$traits$spec$wrappers, wrapper)
  definition <- definition_of(env)
  if (is.null(definition)) {
    functions <- made$around(list(reset = sub_env$reset, step = sub_env$step), NULL)
    wrapped_env$new(new_sub_env(
      made$traits, functions$reset, functions$step, sub_env$render, sub_env$takes_options
    ))
  } else {
    definition$traits <- made$traits
    definition$wrappers <- c(definition$wrappers, list(made$around))
    # A wrapper may change the transitions of the model.
    definition["model"] <- list(NULL)
    function_env$new(definition)
  }
}

# Wraps an object of a user's class.
wrapped_env <- R6Class(
  "gym_wrapped_env",
  inherit = GymEnv,
  public = list(
    initialize = function(sub_env) {
      private$gym_sub_env <- sub_env
      become_sub_env(self, sub_env)
    }
  )
)

make_r_wrapper <- function(traits, wrapper, arguments, call) {
  check_r_wrapper(wrapper, call)
  make <- r_wrappers[[wrapper]]
  check_wrapper_arguments(wrapper, arguments, call)
  rlang::exec(make, traits, !!!arguments, call = call)
}

check_wrapper_arguments <- function(wrapper, arguments, call) {
  make <- r_wrappers[[wrapper]]
  known <- setdiff(names(formals(make)), c("traits", "call"))
  strange <- setdiff(names(arguments), known)
  needed <- known[vapply(formals(make)[known], is_without_default, NA)]
  lacking <- setdiff(needed, names(arguments))
  if (length(strange) || length(lacking)) {
    has <- if (length(known)) paste0("its arguments are `", paste(known, collapse = "`, `"), "`")
    gym_abort(
      paste0(
        wrapper,
        if (length(strange)) " has no argument `" else " needs the argument `",
        c(strange, lacking)[[1L]], "`: ", has %||% "it has none", "."
      ),
      class = "gym_error_argument", argument = c(strange, lacking)[[1L]], call = call
    )
  }
}

is_without_default <- function(formal) rlang::is_missing(formal)

check_r_wrapper <- function(wrapper, call) {
  if (!wrapper %in% names(r_wrappers)) {
    gym_abort(
      c(paste0("There is no wrapper \"", wrapper, "\" for environments written in R."),
        i = paste0("There are ", paste(names(r_wrappers), collapse = ", "), ".")),
      class = "gym_error_argument", argument = "wrapper", value = wrapper, call = call
    )
  }
}

# Each wrapper --------------------------------------------------------------------------

wrap_time_limit <- function(traits, max_episode_steps, call) {
  check_count(max_episode_steps, call = call)
  limit <- as.integer(min(traits$limit, max_episode_steps))
  list(
    traits = change_traits(traits, list(max_episode_steps = limit)),
    around = function(inner, num_envs) inner
  )
}

wrap_clip_action <- function(traits, call) {
  space <- traits$action_space
  check_wrapped_box(space, "ClipAction", "actions", call)
  outside <- space
  outside$low <- rep(-Inf, prod(space$shape))
  outside$high <- -outside$low
  list(
    traits = change_spaces(traits, action_space = outside),
    around = function(inner, num_envs) {
      low <- spread_numbers(space$low, space$shape, num_envs)
      high <- spread_numbers(space$high, space$shape, num_envs)
      change_action(inner, function(action) pmin(pmax(action, low), high))
    }
  )
}

wrap_rescale_action <- function(traits, min_action, max_action, call) {
  space <- traits$action_space
  check_wrapped_box(space, "RescaleAction", "actions", call)
  outside <- rescaled_box(space, min_action, max_action, call)
  if (any(outside$low == outside$high)) {
    must <- paste("above `min_action`, which is", describe_value(min_action))
    abort_argument(max_action, must, "max_action", call)
  }
  list(
    traits = change_spaces(traits, action_space = outside),
    around = function(inner, num_envs) {
      change_action(inner, rescaler(outside, space, num_envs))
    }
  )
}

wrap_rescale_observation <- function(traits, min_obs, max_obs, call) {
  space <- traits$observation_space
  check_wrapped_box(space, "RescaleObservation", "observations", call)
  outside <- rescaled_box(space, min_obs, max_obs, call)
  list(
    traits = change_spaces(traits, observation_space = outside),
    around = function(inner, num_envs) {
      rescale <- rescaler(space, outside, num_envs)
      size <- prod(space$shape) * (num_envs %||% 1L)
      change_observation(inner, function(observation) {
        observation <- double_from_integer64(observation)
        # The checks that follow find an invalid observation.
        if (is.numeric(observation) && length(observation) == size) {
          rescale(observation)
        } else {
          observation
        }
      })
    }
  )
}

wrap_clip_reward <- function(traits, min_reward = NULL, max_reward = NULL, call) {
  check_number(min_reward, allow_null = TRUE, call = call)
  check_number(max_reward, allow_null = TRUE, call = call)
  if (is.null(min_reward) && is.null(max_reward)) {
    gym_abort("ClipReward needs `min_reward` or `max_reward`, or both.",
              class = "gym_error_argument", argument = "min_reward", call = call)
  }
  low <- min_reward %||% -Inf
  high <- max_reward %||% Inf
  if (low > high) {
    abort_argument(max_reward, paste("at least `min_reward`, which is", low), "max_reward", call)
  }
  list(traits = traits, around = function(inner, num_envs) {
    change_reward(inner, function(out) pmin(pmax(out$reward, low), high))
  })
}

wrap_normalize_observation <- function(traits, epsilon = 1e-8, call) {
  space <- traits$observation_space
  if (!is_stackable(space)) {
    abort_wrapped("NormalizeObservation", "observations that are numbers", space, call)
  }
  check_above_zero(epsilon, call = call)
  shape <- space$shape %||% integer()
  size <- prod(shape)
  outside <- space_box(-Inf, Inf, shape)
  outside$names <- space$names
  changed <- change_spaces(traits, observation_space = outside)
  list(traits = changed, around = function(inner, num_envs) {
    n <- num_envs %||% 1L
    moments <- running_moments(size)
    playing <- playing_sub_envs(n)
    inner <- change_observation(inner, function(observation) {
      observation <- double_from_integer64(observation)
      if (!is.numeric(observation) || length(observation) != n * size) {
        return(observation)
      }
      rows <- matrix(as.double(observation), n)
      moments <<- merge_moments(moments, moments_of(rows[playing$which, , drop = FALSE]))
      deviation <- sqrt(variance_of(moments) + epsilon)
      rows <- (rows - rep(moments$mean, each = n)) / rep(deviation, each = n)
      dim(rows) <- dim(observation) %||% if (!is.null(num_envs)) dim(rows)
      rows
    })
    follow_ends(inner, playing)
  })
}

wrap_normalize_reward <- function(traits, gamma = 0.99, epsilon = 1e-8, call) {
  check_number(gamma, min = 0, max = 1, call = call)
  check_above_zero(epsilon, call = call)
  list(traits = traits, around = function(inner, num_envs) {
    n <- num_envs %||% 1L
    moments <- running_moments(1L)
    playing <- playing_sub_envs(n)
    discounted <- numeric(n)
    inner <- change_reward(inner, function(out) {
      if (length(out$reward) != n || !is_flags(out$terminated, n)) {
        return(out$reward)
      }
      # As in Gymnasium, the discounted sum of rewards starts again only after a terminated episode.
      which <- playing$which
      goes_on <- !out$terminated[which]
      discounted[which] <<- discounted[which] * gamma * goes_on + out$reward[which]
      moments <<- merge_moments(moments, moments_of(matrix(discounted[which])))
      out$reward / sqrt(variance_of(moments) + epsilon)
    })
    follow_ends(inner, playing)
  })
}

r_wrappers <- list(
  TimeLimit = wrap_time_limit, ClipAction = wrap_clip_action, RescaleAction = wrap_rescale_action,
  RescaleObservation = wrap_rescale_observation, ClipReward = wrap_clip_reward,
  NormalizeObservation = wrap_normalize_observation, NormalizeReward = wrap_normalize_reward,
  TransformReward = wrap_transform_reward, TransformObservation = wrap_transform_observation,
  TransformAction = wrap_transform_action
)

# What they are made of -----------------------------------------------------------------

change_spaces <- function(traits, observation_space = traits$observation_space,
                          action_space = traits$action_space, call = NULL) {
  changed <- new_traits(observation_space, action_space, traits$spec$id, call = call)
  parts <- c("observation_space", "action_space", "observation_rules", "action_rules",
             "fits_observations", "fits_actions")
  traits[parts] <- changed[parts]
  traits
}

change_action <- function(inner, change) {
  step <- inner$step
  inner$step <- function(action) step(change(double_from_integer64(action)))
  inner
}

change_observation <- function(inner, change) {
  reset <- inner$reset
  step <- inner$step
  inner$reset <- function(seed, options) change(reset(seed, options))
  inner$step <- function(action) {
    out <- step(action)
    if (is.list(out) && !is.null(out$observation)) {
      out$observation <- change(out$observation)
    }
    out
  }
  inner
}

# `change` is a function of the step's result.
change_reward <- function(inner, change) {
  step <- inner$step
  inner$step <- function(action) {
    out <- step(action)
    if (is.list(out) && is.numeric(out$reward)) {
      out$reward <- change(out)
    }
    out
  }
  inner
}

check_wrapped_box <- function(space, wrapper, what, call) {
  if (!inherits(space, "gym_space_box")) {
    abort_wrapped(wrapper, paste(what, "that are a Box"), space, call)
  }
}

abort_wrapped <- function(wrapper, must, space, call) {
  gym_abort(
    paste0(wrapper, " is for ", must, ", and these are ", format(space), "."),
    class = "gym_error_argument", argument = "wrapper", value = space, call = call
  )
}

# Scales --------------------------------------------------------------------------------

# Converts the numbers of a Box from row by row to R's order.
spread_numbers <- function(x, shape, num_envs) {
  x <- rep_len(x, prod(shape))
  if (is.null(num_envs)) {
    as.vector(shape_values(x, shape))
  } else {
    as.vector(shape_values(rep(x, num_envs), c(num_envs, shape)))
  }
}

rescaled_box <- function(space, low, high, call, low_arg = rlang::caller_arg(low),
                         high_arg = rlang::caller_arg(high)) {
  dtype <- if (space$dtype %in% names(dtype_ranges)) "float64" else space$dtype
  check_bound(low, dtype, low_arg, call)
  check_bound(high, dtype, high_arg, call)
  box <- space
  box$dtype <- dtype
  box$low <- spread_bound(low, space$shape, dtype, low_arg, call)
  box$high <- spread_bound(high, space$shape, dtype, high_arg, call)
  if (any(box$low > box$high)) {
    must <- paste0("at least `", low_arg, "`, which is ", describe_value(low))
    abort_argument(high, must, high_arg, call)
  }
  check_same_infinite(space$low, box$low, low, low_arg, call)
  check_same_infinite(space$high, box$high, high, high_arg, call)
  box
}

check_same_infinite <- function(from, to, value, arg, call) {
  unlike <- (is.infinite(from) | is.infinite(to)) & from != to
  if (any(unlike)) {
    must <- paste(from[unlike][[1L]], "where the space is bounded so")
    abort_argument(value, must, arg, call)
  }
}

# A linear function from the numbers of one Box to those of another. A number with only one bound is
# shifted.
rescaler <- function(from, to, num_envs) {
  spread <- function(x) spread_numbers(x, from$shape, num_envs)
  both <- is.finite(from$low) & is.finite(from$high)
  scale <- rep_len(1, length(from$low))
  scale[both] <- (to$high[both] - to$low[both]) / (from$high[both] - from$low[both])
  origin <- ifelse(is.finite(from$low), from$low, ifelse(is.finite(from$high), from$high, 0))
  start <- ifelse(is.finite(to$low), to$low, ifelse(is.finite(to$high), to$high, 0))
  scale <- spread(scale)
  origin <- spread(origin)
  start <- spread(start)
  bounds <- lapply(list(from$low, from$high, to$low, to$high), spread)
  function(x) {
    y <- start + (x - origin) * scale
    # Rounding must not move a number beyond its bounds.
    y <- ifelse(x >= bounds[[1L]], pmax(y, bounds[[3L]]), y)
    y <- ifelse(x <= bounds[[2L]], pmin(y, bounds[[4L]]), y)
    dim(y) <- dim(x)
    y
  }
}

# Running moments -----------------------------------------------------------------------

# Starts like Gymnasium's RunningMeanStd: as if a ten-thousandth of a value had been seen.
running_moments <- function(size) new_moments(1e-4, numeric(size), rep(1e-4, size))

variance_of <- function(moments) moments$squares / moments$count

# The running sub-environments: results of the others are ignored.
playing_sub_envs <- function(n) rlang::env(which = seq_len(n), all = seq_len(n))

follow_ends <- function(inner, playing) {
  reset <- inner$reset
  step <- inner$step
  inner$reset <- function(...) {
    playing$which <- playing$all
    reset(...)
  }
  inner$step <- function(...) {
    out <- step(...)
    n <- length(playing$all)
    if (n > 1L && is.list(out) && is_flags(out$terminated, n)) {
      ended <- out$terminated | (out$truncated %||% FALSE)
      playing$which <- setdiff(playing$which, which(ended))
    }
    out
  }
  inner
}
