#' Get the model of an environment
#'
#' Return the table of transitions of an environment. Gymnasium's FrozenLake, CliffWalking and Taxi
#' have such a model; it depends on the environment's arguments. Your own environment has one if you
#' made it with `gym_env(model = )`.
#'
#' @param env The environment: an id, such as `"FrozenLake-v1"`, or an environment made by
#'   [gym_make()] or [gym_env()], which is not changed.
#' @param ... Arguments of the environment, by name, if it is given by its id, such as
#'   `is_slippery = FALSE`.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the session's client, [gym_client()].
#' @return An object of class [gym_model].
#' @section Errors: `gym_error_no_model`, a kind of `gym_error_argument`, for an environment in R
#'   without a model. `gym_error_http_400` for an environment of Gymnasium without a model, for a
#'   vector environment, or for an environment with wrappers, which may change the transitions.
#' @seealso [solve_mdp()], [gym_model()]
#' @export
#' @examplesIf gym:::can_start_server()
#' lake <- env_model("FrozenLake-v1", is_slippery = FALSE)
#' lake
#' head(as.data.frame(lake))
env_model <- function(env, ..., client = gym_client()) {
  match_whole_names()
  if (inherits(env, "gym_model")) {
    check_dots_empty(...)
    return(env)
  }
  check_environment(env)
  if (rlang::is_string(env) || inherits(env, "gym_wrapped")) {
    if (!is_registered(env)) {
      env <- gym_make(env, ..., client = client)
      on.exit(close_quietly(env))
      return(model_of_env(env, rlang::current_env()))
    }
    env <- gym_make(env, ...)
  } else {
    check_dots_empty(...)
  }
  model_of_env(env, rlang::current_env())
}

# Converts an argument to a model.
as_model <- function(x, call = rlang::caller_env()) {
  if (inherits(x, "gym_model")) {
    return(x)
  }
  if (!rlang::is_string(x) && !inherits(x, "gym_env")) {
    abort_argument(x, "a model, or an environment that has one", "model", call)
  }
  naming_own_call(env_model(x), "env_model", call)
}

model_of_env <- function(env, call) UseMethod("model_of_env")

#' @exportS3Method
model_of_env.default <- function(env, call) abort_without_model(env, call)

#' @exportS3Method
model_of_env.gym_server_env <- function(env, call) {
  route <- paste0(instance_route(env$instance_id), "model/")
  described <- get_answer(env$client, route, call = call)$model
  column <- function(name, type) as.vector(unlist(described[[name]]), type)
  table <- data.frame(
    state = column("state", "integer"), action = column("action", "integer"),
    next_state = column("next_state", "integer"),
    probability = column("probability", "numeric"), reward = column("reward", "numeric"),
    terminated = column("terminated", "logical")
  )
  new_model(
    table, env$observation_space, env$action_space,
    stats::setNames(column("start", "numeric"), state_numbers(env$observation_space)),
    env$spec[c("id", "reward_threshold", "max_episode_steps")], call
  )
}

# A wrapper in R may change the transitions, and the server's table does not show that.
#' @exportS3Method
model_of_env.gym_wrapped_server_env <- function(env, call) abort_without_model(env, call)

#' @exportS3Method
model_of_env.gym_r_env <- function(env, call) {
  model <- definition_of(env)$model
  if (is.function(model)) {
    model <- model(env)
  }
  if (is.null(model)) {
    abort_without_model(env, call)
  }
  is_table <- is.data.frame(model)
  if (is_table) {
    model <- gym_model(model)
  }
  model <- with_spaces_of(env, model, call)
  if (is_table) {
    model$start <- starts_of(env, model, call)
  }
  model
}

# The number of resets that estimate the starting states drawn by `reset()`.
most_resets <- 1000L

# Estimates the probability that an episode starts in each state of a model, by resetting a copy of
# the sub-environment.
starts_of <- function(env, model, call) {
  definition <- definition_of(env)
  sub_env <- definition_sub_env(definition, if (definition$vectorized) most_resets)
  reset <- function(seed = NULL) as.double(reset_sub_env(sub_env, seed, call = call))
  first <- reset(1)
  draws <- !identical(sub_env$generator$state, new_generator(1)$state)
  more <- if (draws && !definition$vectorized) seq_len(most_resets - 1L)
  seen <- c(first, unlist(lapply(more, function(again) reset())))
  states <- state_numbers(model$observation_space)
  stuck <- setdiff(seen, model$transitions$state)
  abort_if(
    length(stuck), "model", model, call,
    "`reset()` of {environment_label(env)} starts in state {stuck[[1L]]}, but no row of the model
     leaves that state."
  )
  count <- length(unique(seen))
  if (count > 1L) {
    cli::cli_inform(
      c(i = "{length(seen)} resets started in {count} states and estimate their probabilities.",
        " " = "Set the probabilities by `gym_model(start = )`."),
      class = "gym_message_model"
    )
  }
  stats::setNames(tabulate(match(seen, states), length(states)) / length(seen), states)
}

abort_without_model <- function(env, call) {
  gym_abort(
    c(paste0(environment_label(env), " has no model."),
      i = "`gym_env(model = )` gives an environment one, `estimate_model()` makes one of steps."),
    class = c("gym_error_no_model", "gym_error_argument"), argument = "env", value = env,
    call = call
  )
}

# Gives the model the environment's spaces, which may have more states and actions than the table.
with_spaces_of <- function(env, model, call) {
  if (!inherits(model, "gym_model")) {
    abort_argument(model, "a model or its table of transitions", "gym_env(model = )", call)
  }
  table <- model$transitions
  numbers <- list(
    observation_space = c(table$state, table$next_state), action_space = table$action
  )
  spaces <- lapply(rlang::set_names(names(numbers)), function(name) {
    # Of several sub-environments, one is enough.
    space <- env[[paste0("single_", name)]] %||% env[[name]]
    check_has_numbers(space, numbers[[name]], name, env, call)
    space
  })
  new_model(
    table, spaces$observation_space, spaces$action_space, model$start[model$start > 0],
    env$spec[c("id", "reward_threshold", "max_episode_steps")], call
  )
}

check_has_numbers <- function(space, numbers, name, env, call) {
  what <- sub("_", " ", name)
  if (!inherits(space, "gym_space_discrete")) {
    count <- space_index(space)$count
    abort_wrong(
      "model", space, call,
      "A model needs an {what} that is Discrete for now, but {environment_label(env)} has
       {format(space)}.",
      i = if (!is.null(count)) {
        'Code the parts as one number, the last part changing first, with `{name} =
         space_discrete({sprintf("%.0f", count)})`.'
      }
    )
  }
  bounds <- space_bounds(space)
  beyond <- numbers[numbers < bounds$low | numbers > bounds$high]
  abort_if(
    length(beyond), "model", beyond[[1L]], call,
    "The model of {environment_label(env)} has the number {beyond[[1L]]}, which its {what}
     {format(space)} does not have.",
    i = "`space_discrete(n, start)` has the numbers from `start` to `start + n - 1`."
  )
}
