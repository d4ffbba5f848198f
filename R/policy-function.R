# Functions as policies. They are called with a batch of observations.

check_takes_observations <- function(policy, arg, call) {
  # args() is NULL for the few primitives that take any arguments.
  declared <- args(policy)
  if (!is.null(declared) && !length(formals(declared))) {
    abort_wrong(
      arg, policy, call, "`{arg}` must be a function of observations; this one has no argument.",
      i = "An example: `function(observation) as.integer(observation[, 3] > 0)`."
    )
  }
}

#' Call a function with one observation before the first step
#'
#' A function that fails for a single observation would otherwise fail late, when only one episode
#' is still running.
#' @param one A batch of one observation.
#' @noRd
ask_about_one <- function(policy, one, vector_env) {
  if (inherits(policy, "gym_policy_memory")) {
    policy <- policy_rows(with_memory(policy, 1L), 1L, 1L)
  }
  tryCatch(
    keep_random_state(act_batch(policy, one, 1L, vector_env)),
    gym_error = function(cnd) rlang::cnd_signal(cnd),
    error = function(cnd) {
      gym_abort(
        c("The policy failed for a single observation, before the first step.",
          i = observations_hint(vector_env$observation_space),
          i = paste("There may be only one, as when all episodes but one have ended;",
                    "`drop = FALSE` keeps one row of a matrix a matrix."),
          i = if (inherits(policy, "gym_policy_memory")) memory_form(policy$initial)),
        class = c(own_classes(cnd), "gym_error_argument"),
        argument = "policy", value = policy, call = vector_env$call, parent = cnd
      )
    }
  )
}

# Was it raised by if () or && for several observations? They pass the test with a single one.
is_about_one <- function(cnd) {
  grepl("the condition has length > 1|in coercion to 'logical\\(1\\)'", conditionMessage(cnd))
}

abort_about_one <- function(cnd, vector_env) {
  gym_abort(
    c("The policy failed for several observations.",
      i = observations_hint(vector_env$observation_space),
      i = "`if ()` and `&&` take one; `ifelse()` and `&` work for each of many."),
    class = c(own_classes(cnd), "gym_error_argument"), argument = "policy",
    call = vector_env$call, parent = cnd
  )
}

#' Convert the result of a function to a batch of actions
#'
#' Checks that there is one action for each sub-environment. The environment checks whether each is
#' an action of its space.
#' @noRd
batch_actions <- function(actions, n, vector_env) {
  space <- vector_env$action_space
  actions <- as_batch(space, actions)
  if (!is.null(attributes(actions)) || is.list(actions)) {
    actions <- action_by_name(space, actions, vector_env$spec$id, vector_env$call)
  }
  count <- batch_length(space, actions)
  if (is.na(count) || count != n) {
    abort_action_count(actions, count, n, vector_env)
  }
  actions
}

abort_action_count <- function(actions, count, n, vector_env) {
  returned <- if (is.na(count)) describe_argument(actions) else count_of(count, "action")
  abort_wrong(
    "policy", actions, vector_env$call,
    'The policy must give one action for
     {if (n == 1L) "the one observation" else paste("each of", n, "observations")}, not
     {returned}.',
    i = "{observations_hint(vector_env$observation_space)}",
    i = "{actions_hint(vector_env$action_space)}"
  )
}

# Hints for a function written for a single observation.
observations_hint <- function(space) {
  if (inherits(space, "gym_space_discrete") || inherits(space, "gym_space_text")) {
    "It is asked about many observations at once: `observation` is a vector of them."
  } else if (length(space$shape) == 1L && !is.null(space$names)) {
    name <- space$names[[min(3L, length(space$names))]]
    paste0("It is asked about many observations at once, each a row of a matrix with the columns ",
           few_names(space$names), ": the ", name, " of each is `observation[, \"", name, "\"]`.")
  } else if (is.null(space) || length(space$shape) == 1L) {
    paste("It is asked about many observations at once, each a row of a matrix: the third",
          "number of each is `observation[, 3]`.")
  } else if (has_parts(space)) {
    names <- space$names %||% names(space$spaces)
    paste0("It is asked about many observations at once, whose parts",
           if (length(names)) paste0(", ", few_names(names), ","), " have a row for each of them.")
  } else {
    "It is asked about many observations at once: the first dimension counts them."
  }
}

actions_hint <- function(space) {
  if (inherits(space, "gym_space_array") && !identical(prod(space$shape), 1)) {
    paste0("An action of ", format(space), " is a row, and so ", if (length(space$shape) > 1L) {
      "several are an array with one dimension more, the first."
    } else {
      "several are a matrix."
    })
  }
}
