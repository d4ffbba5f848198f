# Checks the arguments of train_agent().

check_training <- function(settings, call) {
  check_environment(settings$env, "env", call)
  policy <- settings$policy
  if (learns_online(settings$agent)) {
    if (!is.null(policy) && !inherits(policy, "gym_policy_table")) {
      must <- "NULL, or a table of values made by `policy_table()`"
      abort_argument(policy, must, "policy", call)
    }
  } else if (!inherits(policy, "gym_policy_network")) {
    check_policy(policy, "policy", call)
    abort_no_weights(policy, "policy", call)
  }
  check_number(settings$total_steps, min = 1, allow_null = TRUE, arg = "total_steps", call = call)
  check_number(settings$target, allow_null = TRUE, arg = "target", call = call)
  abort_if(
    is.numeric(settings$seed) && length(settings$seed) > 1L, "seed", settings$seed, call,
    "`seed` is one whole number, not {length(settings$seed)} of them.",
    i = "`seeds` trains once with each of several seeds."
  )
  check_seed(settings$seed, arg = "seed", call = call)
  least <- c(iterations = 1, max_steps = 1, episodes = 1, eval_every = 1, eval_episodes_curve = 0,
             eval_episodes = 2)
  for (name in names(least)) {
    optional <- name %in% c("iterations", "max_steps")
    check_count(settings[[name]], least[[name]], allow_null = optional, arg = name, call = call)
  }
  if (is.null(settings$iterations) && is.null(settings$total_steps)) {
    abort_no_budget(names(settings$kwargs), settings$agent, NULL, call)
  }
  if (!is.null(settings$callback) && !is.function(settings$callback)) {
    abort_argument(settings$callback, "a function of a training, or NULL", "callback", call)
  }
  if (settings$search && !inherits(settings$agent, "gym_agent_random")) {
    must <- "\"evaluation\" for this agent: only `agent_random()` can be judged by its candidates"
    abort_argument("candidate", must, "solved_by", call)
  }
}

# Without this error `steps` would be taken for an argument of the environment.
check_no_steps <- function(names, call) {
  abort_if(
    "steps" %in% names, "steps", NULL, call,
    "The budget in steps of the environment is the argument `total_steps`, not `steps`.",
    i = "For an environment with an argument `steps`, call `gym_make()` first."
  )
}

# Without this error an argument of the agent would be taken for one of the environment.
check_not_of_agent <- function(names, of_agent, place, call) {
  own <- intersect(names, of_agent)
  abort_if(
    length(own), own[[1L]], NULL, call,
    "`{own[[1L]]}` is an argument of the agent: {sprintf(place, own[[1L]])}.",
    i = "For an environment with an argument `{own[[1L]]}`, call `gym_make()` first."
  )
}

# A misspelt argument would be taken for one of the environment. But a name that only resembles an
# argument may really be one of the environment, so it is an error only if training cannot start
# anyway.
check_spelling <- function(names, choices, can_begin, call) {
  check_no_steps(names, call)
  for (name in names) {
    near <- nearest_name(name, choices)
    abort_if(
      length(near) && (plain_name(near) == plain_name(name) || !can_begin),
      name, NULL, call, "There is no argument `{name}`.",
      i = "Did you mean `{near}`?"
    )
  }
}

# `names` are those of arguments that train_agent() does not have. They may belong to the agent or
# to the environment, or be misspelt.
abort_no_budget <- function(names, agent, presets, call) {
  of_agent <- unlist(lapply(names, nearest_name, names(agent)))
  abort_wrong(
    "iterations", NULL, call,
    "Training needs a budget: give `iterations`, or `total_steps` of the environment.",
    i = "`total_steps = 100000` is enough for a first look.", i = presets,
    i = if (length(names)) {
      "These were taken for arguments of the environment: {quoted_names(names)}."
    },
    i = if (length(of_agent)) {
      "An argument of the agent goes into its parentheses: `{of_agent[[1L]]}`."
    }
  )
}

# A learner explores, so it may reach any state of the model. agent_td() plays a given policy, which
# may never reach a state without an end.
check_training_ends <- function(vector_env, settings, online, call) {
  check_has_end(vector_env, settings$max_steps %||% Inf)
  model <- settings$model
  ends <- is.null(model) || model_limit(model, settings$max_steps) < Inf
  if (!online || ends || inherits(settings$agent, "gym_agent_td")) {
    return()
  }
  state <- state_without_end(model)
  abort_if(
    !is.null(state), "max_steps", NULL, call,
    "An episode of {environment_label(vector_env)} that reaches state {state} never ends.",
    i = "Give `max_steps`, after which an episode is cut off, or let the model end there."
  )
}

check_agent <- function(agent, call) {
  abort_if(
    is.function(agent), "agent", agent, call, "`agent` must be an agent, not a function.",
    i = "Did you forget the parentheses, as in `agent_ars()`?"
  )
  abort_if(
    !inherits(agent, "gym_agent"), "agent", agent, call,
    "`agent` must be an agent made by a function such as `agent_ars()`, not
     {describe_argument(agent)}.",
    i = if (is.character(agent)) {
      "There are `agent_random()`, `agent_hill_climb()`, `agent_cem()`, `agent_ars()`,
       `agent_reinforce()`, `agent_ppo()`, `agent_dqn()`, and for tables `agent_monte_carlo()`,
       `agent_td()`, `agent_q()`, `agent_sarsa()`, `agent_actor_critic()`. `learn_sb3()` trains
       by others, such as SAC."
    }
  )
}
