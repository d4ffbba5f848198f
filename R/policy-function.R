# Functions as policies. They are asked about many observations at once.

check_takes_observations <- function(policy, arg, call) {
  # NULL for the few primitives that take whatever comes.
  declared <- args(policy)
  if (!is.null(declared) && !length(formals(declared))) {
    gym_abort(
      c(
        paste0("`", arg, "` must be a function of observations; this one has no argument."),
        i = "An example: `function(observation) as.integer(observation[, 3] > 0)`."
      ),
      class = "gym_error_argument", argument = arg, value = policy, call = call
    )
  }
}

#' Ask a function about one observation before the first step
#'
#' One that fails when a single episode is left would otherwise do so when most has been played.
#' Where a single episode is played, the first step asks this anyway.
#' @param observation What is observed first, one row for each of the sub-environments `playing`.
#' @noRd
ask_beforehand <- function(policy, observation, playing, vector_env) {
  if (!is.function(policy) || length(playing) == 1L) {
    return(invisible())
  }
  one <- sub_env_rows(vector_env$observation_space, observation, 1L)
  tryCatch(
    keep_random_state(act_sub_envs(policy, one, playing[[1L]], vector_env)),
    gym_error = function(cnd) rlang::cnd_signal(cnd),
    error = function(cnd) {
      gym_abort(
        c("The policy failed when it was asked about one observation, before the first step.",
          i = asked_text(vector_env$observation_space),
          i = paste("There may be only one, as when all episodes but one have ended;",
                    "`drop = FALSE` keeps one row of a matrix a matrix.")),
        # Those of the policy's own error stay, for whoever catches it.
        class = c(setdiff(class(cnd), c("simpleError", "rlang_error", "error", "condition")),
                  "gym_error_argument"),
        argument = "policy", value = policy, call = vector_env$call,
        parent = cnd
      )
    }
  )
  invisible()
}

#' Check that there is one action for each sub-environment, and bring them in the form of
#' sub-environments
#'
#' Whether each is an action of the space is for the environment to say.
#' @noRd
sub_env_actions <- function(actions, n, vector_env) {
  actions <- as_sub_envs(vector_env$action_space, actions)
  given <- sub_envs_given(vector_env$action_space, actions)
  if (is.na(given) || given != n) {
    abort_action_count(actions, given, n, vector_env)
  }
  actions
}

as_sub_envs <- function(space, actions) {
  if (has_parts(space)) {
    complete <- is.list(actions) && length(actions) == length(space$spaces)
    if (complete) map_parts(space, as_sub_envs, in_order(space, actions)) else actions
  } else if (is_stackable(space) && prod(space$shape) == 1 && is_column(actions)) {
    column_as_sub_envs(space, actions)
  } else {
    actions
  }
}

# Of actions of one number each a vector and a column mean the same.
is_column <- function(x) {
  is.atomic(x) && length(x) > 0L && length(x) == stack_length(x)
}

column_as_sub_envs <- function(space, actions) {
  if (is.logical(actions) && !identical(space$dtype, "bool")) {
    actions <- as.integer(actions)
  }
  dim(actions) <- if (length(space$shape)) c(length(actions), space$shape)
  actions
}

abort_action_count <- function(actions, given, n, vector_env) {
  gave <- if (is.na(given)) describe_argument(actions) else count_of(given, "action")
  gym_abort(
    c(
      paste0(
        "The policy must give one action for ",
        if (n == 1L) "the one observation" else paste("each of", n, "observations"),
        ", not ", gave, "."
      ),
      i = asked_text(vector_env$observation_space),
      i = answered_text(vector_env$action_space)
    ),
    class = "gym_error_argument", argument = "policy", value = actions, call = vector_env$call
  )
}

# How to write a policy, for those who have written one for a single observation.
asked_text <- function(space) {
  if (inherits(space, "gym_space_discrete") || inherits(space, "gym_space_text")) {
    "It is asked about many observations at once: `observation` is a vector of them."
  } else if (is.null(space) || length(space$shape) == 1L) {
    paste("It is asked about many observations at once, each a row of a matrix: the third",
          "number of each is `observation[, 3]`.")
  } else if (has_parts(space)) {
    "It is asked about many observations at once, whose parts have a row for each of them."
  } else {
    "It is asked about many observations at once: the first dimension counts them."
  }
}

answered_text <- function(space) {
  if (inherits(space, "gym_space_array") && !identical(prod(space$shape), 1)) {
    paste0("An action of ", format(space), " is a row, and so ", if (length(space$shape) > 1L) {
      "several are an array with one dimension more, the first."
    } else {
      "several are a matrix."
    })
  }
}
