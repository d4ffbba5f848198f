# Environments written in R, played step by step like those of gym_make().

# The methods that play an environment, for any functions of the user.
checked_methods <- function(sub_env) {
  list(
    reset = function(seed = NULL, options = NULL, return_info = FALSE) {
      check_sub_env_open(sub_env)
      seed <- plain_numbers(seed)
      check_seed(seed, min = 0)
      check_flag(return_info)
      if (!is.null(options)) {
        check_named_list(options)
      }
      observation <- reset_sub_env(sub_env, seed, options, call = rlang::current_env())
      if (return_info) list(observation = observation, info = list()) else observation
    },
    step = function(action) step_r_env(sub_env, action),
    render = function() {
      call <- rlang::current_env()
      check_sub_env_open(sub_env, call)
      check_was_reset(sub_env, call)
      check_renders(sub_env, call)
      drawn <- draw_sub_env(sub_env, call)
      if (is.raw(drawn)) frame_from_png(drawn) else drawn
    },
    clone = function(deep = FALSE) {
      gym_abort(
        c(paste0(sub_env$traits$spec$id,
                 " cannot be cloned: a clone would share its random generator."),
          i = "Make another one instead."),
        class = "gym_error_argument", argument = "env"
      )
    }
  )
}

step_r_env <- function(sub_env, action, call = rlang::caller_env()) {
  check_sub_env_open(sub_env, call)
  traits <- sub_env$traits
  which <- if (!is.null(sub_env$num_envs)) seq_len(sub_env$num_envs)
  check_was_reset(sub_env, call)
  action <- checked_action(traits, narrow_values(action), which, call)
  out <- complete_step(raw_step(sub_env, action, call), sub_env, call = call)
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
