# Settings that solve environments, and the functions that make an agent and train it in one call.

#' Settings that solve environments
#'
#' [search_ars()], [search_cem()], [learn_ppo()], [learn_reinforce()], [learn_dqn()], [learn_q()],
#' [learn_sarsa()], [learn_monte_carlo()] and [learn_sb3()] use these settings if the environment is
#' given by its id and has a row here. A message says so. Arguments that you give replace those of
#' the preset.
#'
#' With one or two seeds, the learners of tables reached these mean returns. FrozenLake (at best
#' 0.744): 0.73 to 0.74 by Q-learning, 0.73 by Sarsa, 0.71 to 0.73 by Monte Carlo. FrozenLake8x8
#' (0.913): 0.86 by Q-learning, 0.85 by Sarsa. Taxi (7.93): 7.87 to 7.89 by Q-learning, 7.4 to 7.7
#' by Sarsa. CliffWalking (-13): -13 by Q-learning, -19 to -17 by Sarsa. Blackjack (-0.043): -0.075
#' by Monte Carlo, with a standard error of 0.014. The registered threshold of Taxi, 8, is above the
#' best possible return, so a training uses its whole budget.
#'
#' @param env_id The id of an environment, a string, to get its presets only. `NULL`, the default,
#'   returns all.
#' @return A data frame with a row for each preset:
#'   \describe{
#'   \item{env_id, kwargs}{The environment's id, a string (`"ALE/*"` for all Atari games), and its
#'   arguments as JSON, empty for none.}
#'   \item{agent}{`"ars"`, `"cem"`, `"ppo"`, `"reinforce"`, `"dqn"`, `"q"`, `"sarsa"` or
#'   `"monte_carlo"`, or in capitals an algorithm of [learn_sb3()], such as `"SAC"`. The agent's
#'   arguments have a column each, see [agent_ars()] and the others; `NA` for an argument that the
#'   agent does not have or whose default it keeps.}
#'   \item{arguments, policy, num_envs}{Of [learn_sb3()]: the algorithm's arguments as JSON, the
#'   policy's name, and the number of sub-environments.}
#'   \item{hidden, bias}{The policy of a search: the number of hidden neurons (tanh, with normalised
#'   observations), `NA` for a linear policy, and whether it has a bias.}
#'   \item{hidden, init, normalize}{The network of the other agents: the number of neurons in each
#'   of its two hidden layers and how its first weights are drawn, `NA` for the agent's default (64,
#'   `"orthogonal"`), and whether it gets normalised observations.}
#'   \item{linear, epsilon_steps}{If `linear` is `TRUE`, `learning_rate` and `clip` decrease from
#'   their values to 0 over `total_steps`. `epsilon` decreases from 1 to its value over
#'   `epsilon_steps`.}
#'   \item{episodes, eval_every, total_steps, max_steps}{Of the training; `total_steps` is its
#'   budget. Agents with long iterations are evaluated more often than after every ten of them.}
#'   \item{origin, source, tried}{`origin` is `"paper"` or `"zoo"` (rl-baselines3-zoo), with the
#'   `source`, or `"ours"`. `tried` is the number of settings that were tried with seeds 1 to 99
#'   before these were chosen (an integer; `NA` for the zoo's). `vignette("solved")` reports other
#'   seeds.}
#'   }
#' @section Errors: `gym_error_argument` if `env_id` is not a string.
#' @export
#' @examples
#' agent_presets()[c("env_id", "agent", "directions", "step_size", "noise", "origin")]
agent_presets <- function(env_id = NULL) {
  check_string(env_id, allow_null = TRUE)
  presets <- lapply(paste0(c("agent", "sb3"), "-presets.csv"), read_presets, env_id)
  columns <- unique(unlist(lapply(presets, names)))
  do.call(rbind, lapply(presets, function(table) {
    others <- setdiff(columns, names(table))
    table[others] <- rep(list(rep(NA, nrow(table))), length(others))
    table[columns]
  }))
}

# Reads the presets of this package's agents, or those of learn_sb3() from "sb3-presets.csv".
read_presets <- function(name = "agent-presets.csv", env_id = NULL) {
  file <- system.file("extdata", name, package = "gym", mustWork = TRUE)
  presets <- utils::read.csv(file, stringsAsFactors = FALSE)
  for (name in c("kwargs", "source")) {
    presets[[name]][is.na(presets[[name]])] <- ""
  }
  if (!is.null(env_id)) {
    games <- grepl("^ALE/", env_id)
    presets <- presets[presets$env_id == env_id | games & presets$env_id == "ALE/*", ]
  }
  row.names(presets) <- NULL
  presets
}

# Returns the preset of an agent for an environment with these arguments, a list, or `NULL`.
find_preset <- function(agent, env, kwargs, file = "agent-presets.csv") {
  if (!is.character(env)) {
    return(NULL)
  }
  presets <- read_presets(file, env)
  presets <- presets[presets$agent == agent, ]
  for (row in seq_len(nrow(presets))) {
    preset <- as.list(presets[row, ])
    own <- if (nzchar(preset$kwargs)) from_json(preset$kwargs) else list()
    if (setequal(names(own), names(kwargs)) && all(mapply(identical, own, kwargs[names(own)]))) {
      return(preset_settings(preset))
    }
  }
  NULL
}

preset_settings <- function(row) {
  Filter(function(value) !is.na(value) && !identical(value, ""), as.list(row))
}

# The arguments that a preset supplies to the function that makes its agent.
preset_arguments <- function(preset) {
  if (is.null(preset)) {
    return(list())
  }
  if (isTRUE(preset$linear)) {
    falling <- intersect(c("learning_rate", "clip"), names(preset))
    preset[falling] <- lapply(preset[falling], schedule_linear, 0, preset$total_steps)
  }
  if (!is.null(preset$epsilon_steps)) {
    preset$epsilon <- schedule_linear(1, preset$epsilon, preset$epsilon_steps)
  }
  make <- get(paste0("agent_", preset$agent), mode = "function")
  preset[intersect(names(formals(make)), names(preset))]
}

#' Make an agent and train it
#'
#' @param make The name of the function that makes the agent.
#' @param env The user's environment.
#' @param ... Arguments of `make`, of [train_agent()] and of the environment.
#' @param defaults Arguments of [train_agent()] that are used if neither the user nor the preset
#'   gives them.
#' @param frame The frame of the user's call.
#' @noRd
make_and_train <- function(make, env, ..., defaults = list(), frame = rlang::caller_env()) {
  match_whole_names(frame)
  # Check before list(...) evaluates an argument that may create something.
  check_no_steps(...names(), frame)
  dots <- list(...)
  check_dots_named(dots, "iterations = 100", frame)
  check_environment(env, "env", frame)
  of_agent <- names(formals(make))
  of_training <- names(formals(train_agent))
  kwargs <- dots[!names(dots) %in% c(of_agent, of_training)]
  # An argument of the agent that is NULL was not given.
  optional <- names(dots) %in% c(of_agent, "policy", "iterations", "total_steps", "target",
                                    "episodes")
  given <- dots[!(optional & vapply(dots, is.null, NA))]
  preset <- find_preset(sub("agent_", "", make), env, kwargs)
  earlier <- if (!"policy" %in% of_agent) given$policy
  goes_on <- goes_on_from(earlier, paste0("gym_", make))
  # An earlier training goes on with its own settings.
  arguments <- if (goes_on) own_arguments(earlier$agent) else preset_arguments(preset)
  arguments <- replace_arguments(arguments, given[intersect(of_agent, names(given))])
  agent <- naming_own_call(rlang::exec(make, !!!arguments), make, frame)
  training <- given[intersect(names(given), setdiff(of_training, c(of_agent, "client")))]
  if (goes_on && !any(of_budget %in% names(training))) {
    training <- c(training, Filter(Negate(is.null), earlier$rules[of_budget]))
  }
  budget <- !is.null(preset) || any(of_budget %in% names(training))
  check_spelling(names(kwargs), c(of_agent, of_training), budget, frame)
  if (!budget) abort_no_budget(names(kwargs), NULL, other_presets_text(env), frame)
  if (!is.null(preset) && !goes_on) {
    inform_of_preset(preset, env)
    agent <- with_preset(agent, preset, names(given))
  }
  arguments <- complete_arguments(agent, env, training, preset, defaults)
  # An empty list has no names, as in train_agent(): checkpoints compare it.
  if (!length(kwargs)) kwargs <- list()
  start_training(arguments, kwargs, client = given$client %||% gym_client(), frame)
}

# Replaces arguments of an agent by the user's. The preset's `top` does not fit other `directions`
# or another `version`, nor its `elite` another `population`.
replace_arguments <- function(arguments, given) {
  if (any(c("directions", "version") %in% names(given))) arguments$top <- NULL
  if ("population" %in% names(given)) arguments$elite <- NULL
  arguments[names(given)] <- given
  arguments
}

of_budget <- c("iterations", "total_steps")

#' Complete the arguments of [train_agent()]
#' @param given The arguments that the user has given, which replace the preset's. `iterations`
#'   replaces the preset's `total_steps`.
#' @param defaults Arguments that are used if neither the user nor the preset gives them.
#' @return A list of all arguments but `...` and `client`.
#' @noRd
complete_arguments <- function(agent, env, given, preset, defaults = list()) {
  arguments <- as.list(formals(train_agent))
  arguments <- lapply(arguments[setdiff(names(arguments), c("agent", "env", "...", "client"))],
                      eval, environment(train_agent))
  of_preset <- c("episodes", "eval_every", "max_steps",
                 if (!any(of_budget %in% names(given))) "total_steps")
  for (some in list(defaults, preset[intersect(of_preset, names(preset))], given)) {
    arguments[names(some)] <- some
  }
  if (!is.null(preset)) arguments$policy <- arguments$policy %||% preset_policy(preset, agent)
  c(list(agent = agent, env = env), arguments)
}

# Records in the agent where its settings come from, for provenance().
with_preset <- function(agent, preset, given) {
  if (is.null(preset)) {
    return(agent)
  }
  agent$preset <- preset[intersect(c("env_id", "kwargs", "origin", "source"), names(preset))]
  agent$preset$changed <- intersect(given, c(names(preset), "policy", "iterations"))
  agent
}

# Name the presets of the environment if the user's arguments fit none of them.
other_presets_text <- function(env) {
  presets <- if (is.character(env)) read_presets(env_id = env)
  if (NROW(presets)) {
    known <- paste0("\"", presets$agent, "\"", ifelse(nzchar(presets$kwargs), " with ", ""),
                    presets$kwargs, collapse = ", ")
    paste0("There are presets of ", env, " for other arguments or another agent: ", known, ".")
  }
}

preset_policy <- function(preset, agent) {
  if (inherits(agent, "gym_agent_gradient")) {
    policy <- default_policy(agent)
    if (!is.null(preset$hidden)) policy$sizes[2:3] <- preset$hidden
    policy$init <- preset$init %||% policy$init
    if (isTRUE(preset$normalize)) policy$moments <- no_moments()
    policy
  } else if (learns_online(agent)) {
    # A learner makes its own policy.
    NULL
  } else if (is.null(preset$hidden)) {
    policy_linear(bias = preset$bias)
  } else {
    policy_network(
      c(NA, preset$hidden, NA), c("tanh", "identity"), bias = preset$bias, normalize = TRUE
    )
  }
}

inform_of_preset <- function(preset, env) {
  origin <- paste0(preset$origin, if (preset$origin == "paper") paste0(": ", preset$source))
  rlang::inform(
    c(i = paste0("Using the preset for ", env, " (", origin, "), see `agent_presets(\"", env,
                 "\")`.")),
    class = "gym_message_preset"
  )
}
