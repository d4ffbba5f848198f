# Binding a network to an environment. The network needs an input for each number of an observation,
# and an output for each action, or for each number of an action.

#' @exportS3Method
policy_bind.gym_policy_network <- function(policy, env, call = rlang::caller_env()) {
  env <- one_sub_env(env)
  if (is.na(policy$output)) {
    policy$output <- if (inherits(env$action_space, "gym_space_box")) "gaussian" else "softmax"
  }
  policy <- with_sizes_of(policy, env)
  check_inputs(policy, env, call)
  check_outputs(policy, env, call)
  check_network(policy, call)
  policy$observation_space <- env$observation_space
  policy$action_space <- env$action_space
  policy["env_id"] <- list(env$spec$id)
  policy$wrappers <- env$spec$wrappers
  policy
}

# The spaces of one sub-environment.
one_sub_env <- function(env) {
  if (is.null(env$single_observation_space)) {
    return(env)
  }
  list(
    observation_space = env$single_observation_space, action_space = env$single_action_space,
    spec = env$spec
  )
}

# Fills in the sizes that depend on the environment, and the weights.
with_sizes_of <- function(policy, env) {
  if (!anyNA(policy$sizes)) {
    return(policy)
  }
  own <- c(
    space_width(env$observation_space) %||% NA, outputs_for(env$action_space, policy$output) %||% NA
  )
  ends <- c(1L, length(policy$sizes))
  policy$sizes[ends] <- as.integer(ifelse(is.na(policy$sizes[ends]), own, policy$sizes[ends]))
  if (anyNA(policy$sizes)) {
    return(policy)
  }
  policy <- with_deviations(policy)
  policy$weights <- if (is.null(policy$weights_seed)) {
    lapply(weight_shapes(policy$sizes, policy$bias), array, data = 0)
  } else {
    with_generator(new_generator(policy$weights_seed), draw_first_weights(policy))
  }
  policy$weights_seed <- NULL
  policy
}

check_inputs <- function(policy, env, call) {
  space <- env$observation_space
  inputs <- policy$sizes[[1L]]
  gives <- space_width(space)
  if (is.null(gives)) {
    abort_fit(policy, paste("A network cannot observe", format(space)), env, call)
  }
  discrete <- inherits(space, "gym_space_discrete")
  abort_if(
    !is.null(policy$moments) && discrete, "policy", policy, call,
    "Observations that are numbers of a range can be normalized, but those of
     {environment_label(env)} are {format(space)}.",
    i = "Make the policy with `normalize = FALSE`."
  )
  if (gives != inputs) {
    of_each <- if (discrete) {
      paste("is one of", gives, "and needs an input for each")
    } else {
      paste("has", count_of(gives, "number"))
    }
    problem <- paste0("The network takes ", count_of(inputs, "input"), ", but an observation of ",
                      environment_label(env), " ", of_each)
    abort_fit(policy, problem, env, call)
  }
}

check_outputs <- function(policy, env, call) {
  space <- env$action_space
  outputs <- policy$sizes[[length(policy$sizes)]]
  width <- space_width(space)
  if (is.null(width)) {
    abort_fit(policy, paste("A network cannot choose from", format(space)), env, call)
  }
  discrete <- inherits(space, "gym_space_discrete")
  fits <- switch(policy$output,
    greedy = TRUE,
    gaussian = !discrete && !space$dtype %in% integer_dtypes,
    discrete
  )
  needs <- if (is_gaussian(policy)) "a Box of real numbers" else "a Discrete action space"
  abort_if(
    !fits, "policy", policy, call,
    'The output "{policy$output}" needs {needs}, but {environment_label(env)} takes actions of
     {format(space)}.',
    i = if (!discrete) {
      '`output = "gaussian"` draws numbers, and `agent_ppo()` trains such a network.'
    }
  )
  bounded <- discrete || all(is.finite(c(space$low, space$high)))
  abort_if(
    !bounded && has_range(policy), "policy", policy, call,
    'The outputs of "{output_activation(policy)}" are scaled to the bounds of the action, but
     {environment_label(env)} takes {format(space)} with a side without a bound.',
    i = 'Outputs of "identity" are taken as they are.'
  )
  rounded <- discrete && outputs == 1L && width == 2 && policy$output != "softmax"
  if (outputs != width && !rounded) {
    takes <- if (discrete) "has" else "takes an action of"
    problem <- paste0(
      "The network gives ", count_of(outputs, "output"), ", but ", environment_label(env), " ",
      takes, " ", count_of(width, if (discrete) "action" else "number")
    )
    abort_fit(policy, problem, env, call)
  }
}

# Names the sizes that would fit, with the same hidden layers.
abort_fit <- function(policy, problem, env, call) {
  inputs <- space_width(env$observation_space)
  outputs <- outputs_for(env$action_space, policy$output)
  sizes <- toString(c(inputs, policy$sizes[-c(1L, length(policy$sizes))], outputs))
  abort_wrong(
    "policy", policy, call, "{problem}.",
    i = if (length(inputs) && length(outputs)) "`policy_network(sizes = c({sizes}))` would fit."
  )
}

# The number of outputs for an action space. For two actions a greedy network needs only one output.
# Other networks need an output for each action, because each has a probability or a value.
outputs_for <- function(space, output = "greedy") {
  width <- space_width(space)
  if (output == "greedy" && inherits(space, "gym_space_discrete") && width == 2) 1L else width
}

# The number of inputs for an observation of this space, or of outputs for its actions. NULL for a
# space that a network does not support.
space_width <- function(space) {
  if (inherits(space, "gym_space_discrete")) {
    space$n
  } else if (inherits(space, "gym_space_box")) {
    prod(space$shape)
  }
}
