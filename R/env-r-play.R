# Environments written in R, played step by step like those of gym_make().

# The methods that play an environment, for any functions of the user.
checked_methods <- function(sub_env) {
  list(
    reset = function(seed = NULL, options = NULL, return_info = FALSE) {
      reset_r_env(sub_env, seed, options, return_info)
    },
    step = function(action) step_r_env(sub_env, action),
    render = function() render_r_env(sub_env),
    clone = function(deep = FALSE) abort_clone(sub_env)
  )
}

reset_r_env <- function(sub_env, seed, options, return_info, call = rlang::caller_env()) {
  check_sub_env_open(sub_env, call)
  seed <- plain_numbers(seed, call = call)
  check_seed(seed, min = 0, call = call)
  check_flag(return_info, call = call)
  if (!is.null(options)) {
    check_named_list(options, call = call)
  }
  observation <- reset_sub_env(sub_env, seed, options, call = call)
  if (return_info) list(observation = observation, info = list()) else observation
}

step_r_env <- function(sub_env, action, call = rlang::caller_env()) {
  check_sub_env_open(sub_env, call)
  check_was_reset(sub_env, call)
  traits <- sub_env$traits
  action <- narrow_values(action)
  if (is.null(sub_env$num_envs)) {
    check_value(traits$action_rules, action, "", call, bounds = TRUE)
    action <- tidy_value(traits$action_space, action, NULL)
  } else {
    check_actions(traits, action, seq_len(sub_env$num_envs), call)
    action <- tidy_actions(traits$action_space, action)
  }
  out <- raw_step(sub_env, action, call = call)
  out <- complete_step(out, sub_env, call = call)
  if (isTRUE(all(sub_env$ended))) {
    # NA: the episode is over, and the warning has been given.
    sub_env$ended <- NA
    warn_step_after_end(traits$spec$id, call)
  } else {
    sub_env$ended <- sub_env$ended | out$terminated | out$truncated
  }
  list(
    observation = out$observation, reward = out$reward, done = out$terminated | out$truncated,
    info = out$info, terminated = out$terminated, truncated = out$truncated
  )
}

check_sub_env_open <- function(sub_env, call = rlang::caller_env()) {
  if (sub_env$closed) abort_closed("Make a new one.", call)
}

abort_clone <- function(sub_env, call = rlang::caller_env()) {
  gym_abort(
    c(paste0(sub_env$traits$spec$id,
             " cannot be cloned: a clone would share its random generator."),
      i = "Make another one instead."),
    class = "gym_error_argument", argument = "env", call = call
  )
}
