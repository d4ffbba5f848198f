#' Choose an action
#'
#' Return a policy's action for an observation, or many actions for many observations. Nothing
#' changes, except that a [random policy][policy_random()] draws from R's generator.
#'
#' A policy is an object made by [policy_random()] or [policy_network()], or any function that takes
#' many observations, one in each row of a matrix, and returns as many actions. To make another kind
#' of policy, write a method of `act()` for your own class; [rollout()] can then play it. It calls
#' the method with many observations at once.
#'
#' # Functions as policies
#'
#' A function always gets a batch of observations, even if there is only one. For the usual
#' environments the batch is a matrix with an observation in each row. If observations are arrays,
#' the batch is an array with an additional first dimension. If they are single whole numbers, it is
#' an integer vector. If they have several parts (Tuple and Dict), it is a list with such a batch
#' for each part. The number of observations varies, because [rollout()] plays many episodes
#' together and leaves out those that have ended. The result has the same form: a vector with an
#' action for each observation (`TRUE` counts as 1), a matrix with an action in each row, an array,
#' or a list of these for the parts. [rollout()] first calls the function with a single observation,
#' so that errors show at once.
#'
#' A policy that draws its actions, such as a [policy_network()] with the output `"softmax"`, also
#' uses R's generator. `draw = FALSE` returns its most likely action instead.
#'
#' `predict()` returns the same actions (the most likely ones if the policy draws them), or the
#' outputs behind them. It also accepts a data frame of observations. It never uses R's generator.
#'
#' # Saving policies
#'
#' [saveRDS()] saves a policy, and [readRDS()] restores it in any session. A function keeps the
#' variables that it uses if they are not in the global environment. Connections, and environments
#' made by [gym_make()], are lost.
#'
#' @param policy The policy: of class `gym_policy`, or a function of many observations.
#' @param observation The observation. For the usual environments a numeric vector is one
#'   observation, and a numeric matrix or a data frame has one in each row. If observations are
#'   arrays, many of them have an additional first dimension. If they are single whole numbers, many
#'   of them are an integer vector. If you give names (of a vector, or of the columns of a matrix or
#'   a data frame) and the policy knows those of an observation's numbers, they must be the same, in
#'   any order. Further columns of a data frame, such as in the steps of a [rollout()], are ignored.
#'   Without names, numbers are taken by position. A function gets a vector as a matrix of one row.
#' @param draw For a network that draws its actions: draw? `TRUE`, the default, or `FALSE` for the
#'   most likely action, or the one with the largest value.
#' @param ... For methods.
#' @return For one observation one action: a whole number for a discrete action space, a numeric
#'   vector (or array) in the shape of the space for a Box. For `n` observations an integer vector
#'   of length `n`, or a matrix with `n` rows (an array with `n` as its first dimension). For a
#'   Tuple or Dict a list of these for the parts.
#'   `predict()` returns the same; with `type = "output"` a numeric vector of length `n` (a matrix
#'   with `n` rows if the network has several outputs), and with `type = "probability"` a matrix
#'   with a row for each observation and a column for each action.
#' @section Errors: `gym_error_argument` if `policy` is not a policy, the observation does not have
#'   as many numbers as the policy needs, or a function does not return one action for one
#'   observation. From `predict()` also if the policy is not a network.
#' @export
#' @examples
#' policy <- policy_network(sizes = c(4, 2, 1))
#' act(policy, c(0.01, -0.2, 0.03, 0.4))
#'
#' observations <- matrix(rnorm(20), ncol = 4)
#' act(policy, observations)
#'
#' # The pole falls to the right: push the cart to the right.
#' follow_pole <- function(observation) as.integer(observation[, 3] > 0)
#' act(follow_pole, c(0.01, -0.2, 0.03, 0.4))
#' act(follow_pole, observations)
#'
#' predict(policy, observations)
#' predict(policy, observations, type = "output")
act <- function(policy, observation, ...) UseMethod("act")

#' @export
act.default <- function(policy, observation, ...) {
  check_policy(policy)
  abort_wrong(
    "policy", policy, rlang::current_env(),
    "There is no method of `act()` for a policy of class {class(policy)[[1L]]}."
  )
}

#' @export
act.function <- function(policy, observation, ...) {
  if (!is_one_vector(observation)) {
    return(policy(function_rows(observation)))
  }
  action <- policy(function_rows(observation))
  if (is.list(action)) {
    return(action)
  }
  count <- stack_length(action)
  if (count != 1L) {
    abort_action_count(action, count, 1L, list(call = rlang::caller_env()))
  }
  shape <- dim(action)
  dim(action) <- if (length(shape) > 2L) shape[-1L]
  action
}

is_one_vector <- function(observation) is.atomic(observation) && is.null(dim(observation))

# Observations in the form for functions: a vector is one observation, so it becomes a matrix of one
# row.
function_rows <- function(observation) {
  if (is.data.frame(observation)) {
    frame_rows(observation)
  } else if (is_one_vector(observation)) {
    matrix(observation, nrow = 1L, dimnames = list(NULL, names(observation)))
  } else {
    observation
  }
}

# Converts a data frame to a numeric matrix. as.matrix() makes a logical matrix if there are no
# rows.
frame_rows <- function(x) {
  rows <- as.matrix(x)
  if (!nrow(rows)) storage.mode(rows) <- "double"
  rows
}

#' @export
print.gym_policy <- function(x, ...) print_lines(x, paste0("<policy: ", format(x), ">"))

check_policy <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  abort_if(
    identical(x, policy_random) || identical(x, policy_network),
    arg, x, call, "`{arg}` must be a policy, not the function that makes one.",
    i = "Did you forget the parentheses, as in `policy_random()`?"
  )
  if (!inherits(x, "gym_policy") && !is.function(x) && !has_method(x, "act")) {
    own <- class(x)[[1L]]
    abort_wrong(
      arg, x, call,
      "`{arg}` must be a policy or a function of observations, not {describe_argument(x)}.",
      i = if (has_method(x, "predict")) {
        "`as_policy()` makes a policy of a model that predicts actions."
      } else if (is.object(x)) {
        '`.S3method("act", "{own}", f)` makes `f` the method by which objects of its class act.'
      }
    )
  }
  if (is.function(x) && !has_method(x, "act")) {
    check_takes_observations(x, arg, call)
  }
  invisible(x)
}

# Checks a policy, or a list of policies, which become candidates.
check_policies <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  force(arg)
  check_given(x, "`policy_random()` is one, and so is a function of observations.", arg, call)
  x <- trained_policy(x)
  if (!is.list(x) || is.object(x)) {
    return(check_policy(x, arg, call))
  }
  if (!length(x)) abort_argument(x, "a policy, or a list of at least one", arg, call)
  x <- lapply(x, trained_policy)
  for (i in seq_along(x)) {
    check_policy(x[[i]], paste0(arg, "[[", i, "]]"), call)
    check_one_policy(x[[i]], paste0(arg, "[[", i, "]]"), call)
  }
  policy_list(x)
}

# A training stands for its policy, and trainings for the policies of their seeds.
trained_policy <- function(x) {
  if (inherits(x, c("gym_training", "gym_rollout"))) {
    x$policy
  } else if (inherits(x, "gym_trainings")) {
    lapply(x$trainings, `[[`, "policy")
  } else {
    x
  }
}

# Candidates are already several policies, so they cannot be one element of a list.
check_one_policy <- function(x, arg, call) {
  abort_if(
    !is.null(count_candidates(x)),
    arg, x, call, "`{arg}` must be one policy, not {policy_text(x)}.",
    i = "Candidates are given alone: all weights go in one matrix to `policy_candidates()`."
  )
}

# Is there a method of the generic function for a class of the object?
has_method <- function(x, generic) {
  if (!is.object(x)) {
    return(FALSE)
  }
  methods <- lapply(setdiff(.class2(x), "function"), function(class) {
    utils::getS3method(generic, class, optional = TRUE)
  })
  !all(vapply(methods, is.null, NA))
}

policy_text <- function(policy) {
  if (inherits(policy, "gym_policy")) format(policy) else describe_argument(policy)
}

# The text up to the first detail: "random" or "network 4-2-1".
policy_label <- function(policy) sub("(,| over| of ).*", "", policy_text(policy))

# What rollouts and searches need from a policy ---------------------------------

#' Bind a policy to an environment
#'
#' Tell a policy the observation and action spaces of an environment. [rollout()], [train_agent()]
#' and every search do this first. A network whose sizes depend on the environment also gets its
#' sizes and weights. If your package has its own class of policies, write a method for it; without
#' a method a policy stays as it is.
#'
#' @param policy The policy.
#' @param env The environment, as returned by [gym_make()] or [as_vector_env()].
#' @param call The call to name in errors, as in [rlang::abort()].
#' @return The bound policy.
#' @section Errors: `gym_error_argument` if the policy cannot play there.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1")
#' policy_bind(policy_linear(), env)
#' env$close()
policy_bind <- function(policy, env, call = rlang::caller_env()) UseMethod("policy_bind")

#' @exportS3Method
policy_bind.default <- function(policy, env, call = rlang::caller_env()) policy

#' Choose an action for each of many observations
#'
#' @param policy A policy that is bound to the environment.
#' @param observation A batch of observations.
#' @param n The number of observations.
#' @param vector_env As returned by [as_vector_env()].
#' @return A batch of actions, one for each observation.
#' @noRd
act_batch <- function(policy, observation, n, vector_env) UseMethod("act_batch")

#' @exportS3Method
act_batch.default <- function(policy, observation, n, vector_env) {
  plain <- is.function(policy) && !has_method(policy, "act")
  actions <- if (plain) policy(observation) else act(policy, observation)
  batch_actions(actions, n, vector_env)
}

# predict() ----------------------------------------------------------------------------

#' @rdname act
#' @param object A policy made by [policy_network()] or [as_policy()].
#' @param newdata Observations, as for `observation`.
#' @param type `"action"`, the default, returns the policy's actions, or the most likely ones if it
#'   draws them. `"output"` returns the outputs of the network, or the predictions of the model.
#'   `"probability"` returns the probability of each action, for a network with the output
#'   `"softmax"` or `"epsilon-greedy"`, or a table.
#' @export
predict.gym_policy <- function(object, newdata, type = c("action", "output", "probability"), ...) {
  type <- check_choice(type[1L], c("action", "output", "probability"), arg = "type")
  predict_policy(object, newdata, type)
}

predict_policy <- function(policy, newdata, type, call = rlang::caller_env()) {
  UseMethod("predict_policy")
}

#' @exportS3Method
predict_policy.default <- function(policy, newdata, type, call = rlang::caller_env()) {
  abort_wrong(
    "object", policy, call,
    "`predict()` needs the policy to be a network, a table or a model, not {policy_text(policy)}.",
    i = if (inherits(policy, "gym_policy_memory")) {
      "`act(policy, observation, memory)` asks it by hand."
    }
  )
}

#' @exportS3Method
predict_policy.gym_policy_network <- function(policy, newdata, type, call = rlang::caller_env()) {
  check_network(policy, call)
  rows <- network_rows(policy, newdata, "newdata", call)
  if (type == "action") {
    return(rows_action(policy, rows, draw = FALSE, call))
  }
  outputs <- network_outputs(policy, rows$values, call)
  if (type == "probability") {
    if (identical(policy$output, "softmax")) {
      return(softmax_rows(outputs))
    }
    if (!identical(policy$output, "epsilon-greedy")) {
      abort_no_probabilities(policy, call)
    }
    n <- policy$action_space$n %||% max(ncol(outputs), 2L)
    p <- matrix(policy$epsilon / n, nrow(outputs), n)
    best <- discrete_action(NULL, outputs, greedy_policy(policy)) + 1L
    best <- cbind(seq_len(nrow(outputs)), best)
    p[best] <- p[best] + 1 - policy$epsilon
    return(p)
  }
  if (ncol(outputs) == 1L) outputs[, 1L] else outputs
}

abort_no_probabilities <- function(policy, call) {
  abort_wrong(
    "type", "probability", call,
    "Only a policy that draws one of several actions has their probabilities, not
     {policy_text(policy)}.",
    i = '`policy_network(output = "softmax")` makes one.'
  )
}
