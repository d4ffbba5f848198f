# Trainings that go on with the agent of an earlier training.

#' Find the agent that a training starts with
#'
#' An agent that was trained before goes on. So does a new agent if `policy` is an earlier training
#' of the same kind of agent: it takes over everything but the settings. With any other policy the
#' agent starts again.
#' @param search Whether candidates are judged by the tutorial's rule. Such a search always starts
#'   again.
#' @noRd
agent_to_train <- function(agent, policy, search, call) {
  if (!search && goes_on_from(policy, class(agent)[[1L]])) {
    agent <- take_over(policy$agent, agent, call)
  } else if (search || !is.null(policy)) {
    agent$started <- NULL
  }
  if (isTRUE(agent$started)) {
    rate <- agent$learning_rate
    taken <- agent$steps %||% agent$taken
    abort_if(
      is.function(rate) && is_number(taken) && isTRUE(rate(taken) == 0),
      "learning_rate", rate, call,
      'The schedule of `learning_rate` is 0 after the agent\'s {count_of(taken, "step")}, so it
       would learn nothing more.',
      i = "Give a new `learning_rate` along with `policy = training`, or set it:
           `agent$learning_rate <- 1e-4`."
    )
    cli::cli_inform(
      c(i = paste("Going on with a trained agent, with all that it has learned. A new one, made by",
                  "a function such as {.code agent_ppo()}, starts again.")),
      class = "gym_message_continued"
    )
  }
  agent
}

# Whether `x` is a training by an agent of this package and class.
goes_on_from <- function(x, class) {
  inherits(x, "gym_training") && isTRUE(x$agent$started) && class(x$agent)[[1L]] == class &&
    length(settings_of(x$agent))
}

# The name of the function that makes an agent of this package.
maker_of <- function(agent) sub("^gym_", "", class(agent)[[1L]])

# The names of an agent's settings, which are the arguments of the function that makes it.
settings_of <- function(agent) {
  make <- get0(maker_of(agent), topenv(), "function", inherits = FALSE)
  names <- names(formals(make))
  # DQN's argument `memory` is the size of its memory.
  if ("memory_size" %in% names(agent)) names <- sub("^memory$", "memory_size", names)
  intersect(names, names(agent))
}

own_arguments <- function(agent) {
  arguments <- unclass(agent)[settings_of(agent)]
  names(arguments) <- sub("memory_size", "memory", names(arguments))
  arguments
}

# The form of what an agent has learned depends on these settings, so they cannot change.
lasting_settings <- c("features", "double", "baseline", "version", "importance", "memory_size")

take_over <- function(earlier, agent, call) {
  settings <- settings_of(agent)
  differ <- Filter(
    function(name) !is_same(earlier[[name]], agent[[name]]), intersect(lasting_settings, settings)
  )
  if (length(differ)) {
    name <- sub("memory_size", "memory", differ[[1L]])
    abort_wrong(
      name, agent[[differ[[1L]]]], call,
      "The earlier training has another `{name}`, which cannot change when the agent goes on.",
      i = "Give the same `{name}`, or start with the policy alone: `policy =
           agent_policy(training$agent)`."
    )
  }
  earlier[settings] <- agent[settings]
  earlier
}

# Binds an agent that goes on to this environment.
continued_agent <- function(agent, bound, call) {
  if (learns_online(agent)) {
    for (space in names(agent$spaces)) {
      abort_if(
        !identical(format(agent$spaces[[space]]), format(bound[[space]])), "env", NULL, call,
        'The agent has learned with the {sub("_", " ", space)} {format(agent$spaces[[space]])},
         and this environment has {format(bound[[space]])}.'
      )
    }
  } else if (!is.null(agent$policy)) {
    agent$policy <- bound
  }
  agent
}

#' Find the policy to train
#' @param agent As agent_to_train() returns it.
#' @return A policy, or `NULL` for a learner that makes its own.
#' @noRd
policy_to_train <- function(policy, agent) {
  online <- learns_online(agent)
  own <- if (isTRUE(agent$started)) {
    if (!online) agent$policy
  } else if (inherits(agent, "gym_agent_gradient") && inherits(policy, "gym_training") &&
               inherits(policy$agent, "gym_agent_gradient")) {
    # Start with the policy that was trained, which draws its actions, and not with the greedy
    # policy that was evaluated.
    agent_policy(policy$agent)
  } else {
    trained_policy(policy)
  }
  own %||% if (!online) default_policy(agent)
}
