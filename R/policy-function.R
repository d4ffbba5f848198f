# Functions as policies. A function is called with a batch of observations.

check_takes_observations <- function(policy, arg, call) {
  # args() is NULL for the few primitives that take any arguments.
  declared <- args(policy)
  abort_if(
    !is.null(declared) && !length(formals(declared)),
    arg, policy, call, "`{arg}` must be a function of observations; this one has no argument.",
    i = "An example: `function(observation) as.integer(observation[, 3] > 0)`."
  )
}

#' Call a function with one observation before the first step
#'
#' Some functions fail for a single observation. Without this call they would fail late, when only
#' one episode is still running.
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
          i = paste("A batch has one observation when all episodes but one have ended.",
                    "`drop = FALSE` keeps a single row of a matrix a matrix."),
          i = if (inherits(policy, "gym_policy_memory")) memory_form(policy$initial)),
        class = c(own_classes(cnd), "gym_error_argument"),
        argument = "policy", value = policy, call = vector_env$call, parent = cnd
      )
    }
  )
}

# Did if () or && raise the error for several observations? With a single observation they work.
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
#' Checks that there is one action for each sub-environment. The environment checks later that each
#' action is in its space.
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
    i = observations_hint(vector_env$observation_space), i = actions_hint(vector_env$action_space)
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
    paste0("An action of ", format(space), " is a row, and ", if (length(space$shape) > 1L) {
      "several actions are an array whose first dimension counts them."
    } else {
      "several actions are a matrix."
    })
  }
}

# With a memory --------------------------------------------------------------------------

# Policies with a memory: earlier observations or actions influence the next action.
#
# The package keeps the memory, with a row for each sub-environment. Episodes that are played
# together do not share a row, and every episode starts with the same memory.

#' Make a policy with a memory
#'
#' Make a policy that remembers something from step to step: a PID controller, a moving average, a
#' small recurrent network. The package keeps one memory for each episode and starts every episode
#' with `initial`, so episodes never share a memory, even if they are played together.
#'
#' Such a policy always plays step by step from R. It works in every environment that [rollout()]
#' and [evaluate_policy()] play, on a server or [in R][gym_env()], also with workers and in a list
#' with other policies. [saveRDS()] saves it like a function.
#'
#' A plain function cannot remember anything by `<<-`: one call has the observations of several
#' episodes, and a new episode would start with the memory of another.
#'
#' @param act A function of `observation` and `memory`. `observation` has many observations, as for
#'   [act()]: for the usual environments a matrix with one in each row. `memory` has as many rows.
#'   It is a matrix if `initial` is a vector, and a data frame if `initial` is a list or a data
#'   frame. The function returns `list(action = , memory = )`: an action for each observation, and
#'   the new memory with the same rows and columns.
#' @param initial The memory at the start of an episode: a numeric vector (its names become column
#'   names), or a list or data frame of one row.
#' @return A policy of class `gym_policy_memory`. `act(policy, observation, memory)` returns the
#'   list that the function returns; without `memory`, every observation is the first of an episode
#'   and has the memory `initial`.
#' @section Errors: `gym_error_argument` for an invalid `act` or `initial`. Playing raises it if
#'   `act` does not return the list described above.
#' @export
#' @examples
#' # A PID controller that holds the pole of CartPole upright.
#' pid <- policy_memory(
#'   function(observation, memory) {
#'     error <- observation[, 3]
#'     sum <- memory[, "sum"] + error
#'     push <- 1 * error + 0.01 * sum + 10 * (error - memory[, "error"])
#'     list(action = as.integer(push > 0), memory = cbind(error = error, sum = sum))
#'   },
#'   initial = c(error = 0, sum = 0)
#' )
#'
#' # Without rollout(), pass the memory from one call to the next.
#' first <- act(pid, c(0, 0, 0.02, 0))
#' act(pid, c(0, 0, 0.01, 0), first$memory)
#' @examplesIf gym:::can_start_server()
#'
#' evaluate_policy("CartPole-v1", pid, episodes = 20, seed = 1)
policy_memory <- function(act, initial) {
  call <- rlang::current_env()
  must <- "a function of `observation` and `memory`"
  if (!is.function(act)) abort_argument(act, must, "act", call)
  takes <- names(formals(args(act)))
  if (!"..." %in% takes && length(takes) < 2L) {
    alone <- if (length(takes)) paste0("`", takes, "` alone") else "nothing"
    abort_wrong("act", act, call, "`act` must be {must}, not of {alone}.")
  }
  check_given(initial, "It is the memory at the start of an episode, such as `c(sum = 0)`.")
  # A matrix or a data frame of one row.
  memory <- if (is.list(initial)) {
    tryCatch(
      as.data.frame(initial, stringsAsFactors = FALSE, optional = TRUE),
      error = function(cnd) NULL
    )
  } else if (is.vector(initial)) {
    matrix(initial, nrow = 1L, dimnames = if (!is.null(names(initial))) list(NULL, names(initial)))
  } else {
    initial
  }
  if (!length(memory) || !identical(nrow(memory), 1L)) {
    must <- "the memory of one episode: a vector, or a list or data frame of one row"
    abort_argument(initial, must, "initial", call)
  }
  structure(list(act = act, initial = memory), class = c("gym_policy_memory", "gym_policy"))
}

#' @export
format.gym_policy_memory <- function(x, ...) {
  kept <- colnames(x$initial) %||% count_of(ncol(x$initial), "value")
  paste("a function with a memory of", sub("(.*), ", "\\1 and ", toString(kept)))
}

#' @rdname act
#' @param memory For a [policy with a memory][policy_memory()]: the `memory` that it returned in the
#'   previous step.
#' @export
act.gym_policy_memory <- function(policy, observation, memory = NULL, ...) {
  observation <- function_rows(observation)
  n <- if (is.array(observation)) nrow(observation)
  memory <- memory %||% fresh_memory(policy, n %||% 1L)
  asked_with_memory(policy, observation, memory, rlang::current_env())
}

fresh_memory <- function(policy, n) policy$initial[rep(1L, n), , drop = FALSE]

# Calls the function and checks its result.
asked_with_memory <- function(policy, observation, memory, call) {
  said <- policy$act(observation, memory)
  new <- if (is.list(said)) said[["memory"]]
  if (is.null(new) || is.null(said[["action"]])) {
    abort_memory(said, "a list of `action` and `memory`", call)
  }
  same <- identical(dim(new), dim(memory)) && is.data.frame(new) == is.data.frame(memory) &&
    (is.null(colnames(memory)) || identical(colnames(new), colnames(memory)))
  if (!same) {
    must <- paste0(
      "a `memory` of ", size_text(memory), ", as it was given",
      if (!is.null(colnames(memory))) paste0(" (", toString(colnames(memory)), ")")
    )
    abort_memory(new, must, call)
  }
  said[c("action", "memory")]
}

size_text <- function(memory) {
  paste(count_of(nrow(memory), "row"), "and", count_of(ncol(memory), "column"))
}

abort_memory <- function(value, must, call) {
  abort_wrong(
    "policy", value, call,
    "`act` of a policy with a memory must return {must}, not
     {if (length(dim(value)) == 2L) size_text(value) else describe_argument(value)}.",
    i = "An example: `list(action = as.integer(push > 0), memory = cbind(error, sum))`."
  )
}

# While it plays ---------------------------------------------------------------------------

#' Give each sub-environment of a batch a memory
#' @return The policy. A policy with a memory gets `kept`, an R environment with the `memory` of all
#'   sub-environments.
#' @noRd
with_memory <- function(policy, num_envs) {
  if (inherits(policy, "gym_policy_list")) {
    policy_list(lapply(unclass(policy), with_memory, num_envs))
  } else if (inherits(policy, "gym_policy_memory")) {
    policy$kept <- rlang::env(memory = fresh_memory(policy, num_envs))
    policy
  } else {
    policy
  }
}

# Sets the memory of sub-environments in which an episode starts.
begin_memory <- function(policy, sub_env) {
  if (inherits(policy, "gym_policy_list")) {
    lapply(unclass(policy), begin_memory, sub_env)
  } else if (inherits(policy, "gym_policy_memory")) {
    policy$kept$memory[sub_env, ] <- fresh_memory(policy, length(sub_env))
  }
}

#' @exportS3Method
policy_rows.gym_policy_memory <- function(policy, candidate, sub_env) {
  policy$sub_env <- sub_env
  policy
}

#' @exportS3Method
act_batch.gym_policy_memory <- function(policy, observation, n, vector_env) {
  kept <- policy$kept
  abort_if(
    is.null(kept), "policy", policy, vector_env$call,
    "The policy has a memory, so its actions do not depend on the observation alone.",
    i = "`rollout()` plays it, which keeps the memory of each episode."
  )
  rows <- policy$sub_env
  said <- asked_with_memory(
    policy, observation, kept$memory[rows, , drop = FALSE], vector_env$call
  )
  kept$memory[rows, ] <- said$memory
  batch_actions(said$action, n, vector_env)
}

# A hint on how to read a number from the memory.
memory_form <- function(initial) {
  name <- colnames(initial)[1L]
  if (is.data.frame(initial)) {
    paste0("`memory` is a data frame with a row for each episode, such as `memory$", name, "`.")
  } else {
    place <- if (is.null(name)) "1" else paste0("\"", name, "\"")
    paste0("`memory` is a matrix with a row for each episode: `memory[, ", place,
           "]`. With a list as `initial` it is a data frame.")
  }
}
